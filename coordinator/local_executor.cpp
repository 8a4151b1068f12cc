#include "coordinator/local_executor.h"

#include <features.h>
#ifdef __GLIBC__
#include <gnu/libc-version.h>
#endif

#include <mutex>
#include <string>

#include "common/archive/chunk.h"
#include "common/base/log.h"
#include "common/base/parallel.h"
#include "worker/gather.h"

namespace glint {
namespace {

class LocalExecutor : public Executor {
 public:
  LocalExecutor(const GatherInput& input, const BakeSettings& settings, const ChunkStore& store, int threads,
                uint64_t memory_bytes)
      : store_(store), threads_(threads), gatherer_(MakeGatherer(input, settings, memory_bytes)) {}

  Status Run(const Round& round, const std::function<void(size_t, bool)>& on_done) override {
    std::mutex mutex;
    Status first_error;
    std::once_flag begun;  // a layer whose results are all there needs no preparing
    ParallelFor(round.tasks.size(), threads_, 1, [&](size_t i, int) {
      {
        const std::lock_guard lock(mutex);
        if (!first_error.ok()) return;
      }
      Result<bool> was_there =
          StopRequested() ? Interrupted("stopped on request") : RunTask(round, round.tasks[i], &begun);
      const std::lock_guard lock(mutex);
      if (was_there.ok()) {
        on_done(i, *was_there);
      } else if (first_error.ok()) {
        first_error = was_there.status();
      }
    });
    return first_error;
  }

 private:
  Result<bool> RunTask(const Round& round, const TaskSpec& task, std::once_flag* begun) {
    if (store_.FindResult(task.key)) return true;
    std::call_once(*begun, [&] { gatherer_->BeginLayer(task.layer, round.previous, threads_); });
    const BlockResult result = gatherer_->Gather(task.block);
    GLINT_ASSIGN_OR_RETURN([[maybe_unused]] const Digest digest,
                           store_.PutResult(task.key, SerializeBlock(result)));
    return false;
  }

  ChunkStore store_;
  const int threads_;
  std::unique_ptr<Gatherer> gatherer_;
};

}  // namespace

std::unique_ptr<Executor> MakeLocalExecutor(const BakeDomain& domain, const RayScene& rays,
                                            const DirectionGrid& grid, const BakeSettings& settings,
                                            const ChunkStore& store, int threads, uint64_t memory_bytes) {
  return std::make_unique<LocalExecutor>(GatherInput{domain, rays, grid}, settings, store, threads,
                                         memory_bytes);
}

std::string ExecutionId() {
  std::string id = "glint " GLINT_VERSION ", gathering " + std::to_string(kGatherRevision) + "; " +
                   RayScene::EngineId() + "; kernels " + GatherKernelLevel() + "; " GLINT_COMPILER;
#ifdef __GLIBC__
  id += std::string(", glibc ") + gnu_get_libc_version();  // its exp, pow, ... have other last bits
#endif
  const std::string flags = GLINT_COMPILER_FLAGS;
  return flags.empty() ? id : id + ", " + flags;
}

}  // namespace glint
