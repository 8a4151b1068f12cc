#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "common/base/status.h"
#include "common/queue/task_queue.h"
#include "worker/worker_meter.h"

namespace glint {

struct WorkerOptions {
  std::filesystem::path store;     ///< work folder with a sub-folder for each bake, shared with coordinators
  std::filesystem::path program;   ///< glint: computes tasks that came back in processes of their own
  int threads = 1;                 ///< tasks at a time
  uint64_t memory_bytes = 0;       ///< bound on hit sets kept between rounds
  double deadline_seconds = 3600;  ///< of one task
  double share_seconds = 30;       ///< with one bake while others have tasks too
  /// Called for a task that is past its deadline; no thread can be ended, so this should end the process.
  std::function<void(const std::string&)> on_stuck;
};

struct WorkerCounts {
  uint64_t computed = 0;  ///< tasks
  uint64_t found = 0;     ///< with their result there already
  uint64_t returned = 0;  ///< to the queue after an error
  uint64_t given_up = 0;  ///< with a record in the bake's folder
};

/// Takes tasks from the queue and computes them until StopRequested(), then finishes those at work. Holds
/// what one bake needs in memory at a time. A task that comes for the first time is computed here; one that
/// comes again, because whoever had it died or failed, in a process of its own; one that fails there and has
/// come three times is given up, with a record of why (common/round/quarantine.h).
/// @param meter  counts while it runs; null: nobody watches
WorkerCounts RunWorker(TaskSource* source, const WorkerOptions& options, WorkerMeter* meter = nullptr);

}  // namespace glint
