#include "common/base/parallel.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace glint {

int ResolveThreadCount(int requested) {
  if (requested > 0) return requested;
  // The cores of a container or of `taskset`, not those of the machine.
  cpu_set_t cores;
  if (sched_getaffinity(0, sizeof cores, &cores) == 0) return std::max(1, CPU_COUNT(&cores));
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void ParallelFor(size_t count, int threads, size_t grain,
                 const std::function<void(size_t i, int thread)>& body) {
  grain = std::max<size_t>(grain, 1);
  const size_t blocks = count / grain + (count % grain != 0 ? 1 : 0);
  std::atomic<size_t> next_block{0};
  std::mutex failure_mutex;
  std::exception_ptr failure;
  const auto work = [&](int thread) {
    try {
      for (size_t block = next_block++; block < blocks; block = next_block++) {
        const size_t begin = block * grain;
        const size_t end = begin + std::min(grain, count - begin);
        for (size_t i = begin; i < end; ++i) body(i, thread);
      }
    } catch (...) {
      next_block = blocks;
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };

  // Threads live for one call: starting them costs tens of microseconds, and nested calls cannot wait for
  // each other.
  const size_t helpers =
      std::min<size_t>(blocks, static_cast<size_t>(std::max(threads, 1))) - (blocks > 0 ? 1 : 0);
  {
    std::vector<std::jthread> pool;
    try {
      pool.reserve(helpers);
      for (size_t t = 1; t <= helpers; ++t) pool.emplace_back(work, static_cast<int>(t));
    } catch (const std::exception&) {
      // No more threads, or no memory for them: those that there are, and this one, do all the work.
    }
    work(0);
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace glint
