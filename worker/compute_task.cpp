#include "worker/compute_task.h"

#include "common/archive/chunk.h"

namespace glint {

Status ComputeTask(const TaskSpec& task, Gatherer& gatherer, ChunkStore* store) {
  return PublishResult(task, gatherer.Gather(task.block), store);
}

Status PublishResult(const TaskSpec& task, const BlockResult& result, ChunkStore* store) {
  // A message that came twice may have had it computed twice at once; what is there is not touched.
  if (store->FindResult(task.key)) return {};
  return store->PutResult(task.key, SerializeBlock(result)).status();
}

}  // namespace glint
