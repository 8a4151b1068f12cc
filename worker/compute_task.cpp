#include "worker/compute_task.h"

#include "common/archive/chunk.h"

namespace glint {
namespace {

BlockResult Gather(const TaskSpec& task, Gatherer& gatherer, WorkerMeter* meter) {
  const MeteredSpan span(meter ? &meter->gather_seconds : nullptr);
  BlockResult result = gatherer.Gather(task.block);
  if (meter) meter->rays += result.counters.rays;
  return result;
}

}  // namespace

Status ComputeTask(const TaskSpec& task, Gatherer& gatherer, ChunkStore* store, WorkerMeter* meter) {
  const BlockResult result = Gather(task, gatherer, meter);
  const MeteredSpan span(meter ? &meter->publish_seconds : nullptr);
  return PublishResult(task, result, store);
}

Status PublishResult(const TaskSpec& task, const BlockResult& result, ChunkStore* store) {
  // A message that came twice may have had it computed twice at once; what is there is not touched.
  if (store->FindResult(task.key)) return {};
  return store->PutResult(task.key, SerializeBlock(result)).status();
}

}  // namespace glint
