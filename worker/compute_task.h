#pragma once

#include <cstdint>
#include <optional>

#include "common/base/status.h"
#include "common/round/task.h"
#include "common/store/store.h"
#include "worker/gather.h"
#include "worker/worker_meter.h"

namespace glint {

/// Computes a task and publishes its chunk: the same bytes wherever it runs. `gatherer` has turned to the
/// task's layer. Thread-safe; safe to repeat. kIo: the chunk cannot be written; kBadInput: the layer before
/// is damaged.
/// @param meter  null: nobody watches
/// @param home   of whoever computes it (TaskNote)
Status ComputeTask(const TaskSpec& task, Gatherer& gatherer, ChunkStore* store, WorkerMeter* meter = nullptr,
                   std::optional<uint32_t> home = std::nullopt);

/// What the gatherer found, and the processor time that it took.
struct GatheredTask {
  BlockResult result;
  double seconds = 0;
};

// The two halves of ComputeTask.
GatheredTask GatherTask(const TaskSpec& task, Gatherer& gatherer);
Status PublishTask(const TaskSpec& task, const GatheredTask& gathered, ChunkStore* store,
                   std::optional<uint32_t> home = std::nullopt);

}  // namespace glint
