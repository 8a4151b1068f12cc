#include "coordinator/local_executor.h"

#include <mutex>
#include <semaphore>
#include <utility>

#include "common/base/parallel.h"
#include "common/scene/ray_scene.h"
#include "worker/compute_task.h"
#include "worker/gather.h"

namespace glint {
namespace {

/// A turn to compute, given back on every way out.
class Turn {
 public:
  explicit Turn(std::counting_semaphore<>* turns) : turns_(turns) { turns_->acquire(); }
  ~Turn() { turns_->release(); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  std::counting_semaphore<>* turns_;
};

class LocalExecutor : public Executor {
 public:
  explicit LocalExecutor(const ExecutorInput& input)
      : rays_(input.domain.positions, input.domain.triangles),
        store_(input.store),
        threads_(input.threads),
        turns_(input.threads),
        stop_(input.stop),
        gatherer_(MakeGatherer({input.domain, rays_, input.grid}, input.settings, input.memory_bytes)) {}

  const Status& status() const { return rays_.status(); }

  Status Run(const Round& round, const std::function<void(size_t, bool)>& on_done) override {
    std::mutex mutex;
    Status first_error;
    std::once_flag begun;  // a layer whose results are all there needs no preparing
    // One more than compute at a time: making a chunk durable waits for the disk, not for a core.
    ParallelFor(round.tasks.size(), threads_ + 1, 1, [&](size_t i, int) {
      {
        const std::lock_guard lock(mutex);
        if (!first_error.ok()) return;
      }
      Result<bool> was_there =
          stop_() ? Interrupted("stopped on request") : RunTask(round, round.tasks[i], &begun);
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
    std::call_once(*begun, [&] {
      gatherer_->BeginLayer(task.layer, round.previous ? &round.previous->views : nullptr, threads_);
    });
    GLINT_RETURN_IF_ERROR(PublishResult(task, Compute(task), &store_));
    return false;
  }

  BlockResult Compute(const TaskSpec& task) {
    const Turn turn(&turns_);
    return gatherer_->Gather(task.block);
  }

  const RayScene rays_;
  ChunkStore store_;
  const int threads_;
  std::counting_semaphore<> turns_;
  const std::function<bool()> stop_;
  std::unique_ptr<Gatherer> gatherer_;
};

}  // namespace

Result<std::unique_ptr<Executor>> MakeLocalExecutor(const ExecutorInput& input) {
  auto executor = std::make_unique<LocalExecutor>(input);
  GLINT_RETURN_IF_ERROR(executor->status());
  return std::unique_ptr<Executor>(std::move(executor));
}

}  // namespace glint
