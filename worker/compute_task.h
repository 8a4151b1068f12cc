#pragma once

#include "common/base/status.h"
#include "common/round/task.h"
#include "common/store/store.h"
#include "worker/gather.h"
#include "worker/worker_meter.h"

namespace glint {

/// Computes a task and publishes its chunk: the same bytes wherever it runs. `gatherer` has turned to the
/// task's layer. Thread-safe; safe to repeat. kIo: the chunk cannot be written.
/// @param meter  null: nobody watches
Status ComputeTask(const TaskSpec& task, Gatherer& gatherer, ChunkStore* store, WorkerMeter* meter = nullptr);

/// Its second half: publishes what the gatherer found.
Status PublishResult(const TaskSpec& task, const BlockResult& result, ChunkStore* store);

}  // namespace glint
