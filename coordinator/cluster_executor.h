#pragma once

#include <functional>

#include "common/base/steady_clock.h"
#include "common/queue/task_queue.h"
#include "coordinator/executor.h"

namespace glint {

void SleepSeconds(double seconds);

struct ClusterOptions {
  int priority = 1;  ///< share of the workers, relative to other bakes', 1 to kMaxPriority
  double lease_seconds =
      30;  ///< a task goes to another worker so long after the last sign of life of its own
  uint64_t max_queued = 20'000;  ///< messages of the bake in the queue at a time
  /// How time passes; tests have a time of their own.
  std::function<void(double seconds)> wait = SleepSeconds;
  std::function<double()> now = SteadySeconds;
};

/// Has a round's tasks run by workers that share the bake's folder and listen to the queue. What is finished
/// is read off the folder alone; the queue may lose everything at any time, and is told again.
/// Run's errors, besides the executor's: kInternal for tasks that workers gave up (quarantined), once nothing
/// else is left to do.
/// @param queue  outlives the executors
ExecutorFactory MakeClusterExecutor(TaskPublisher* queue, const ClusterOptions& options);

}  // namespace glint
