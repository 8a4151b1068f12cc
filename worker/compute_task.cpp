#include "worker/compute_task.h"

#include <ctime>

#include "common/archive/chunk.h"

namespace glint {
namespace {

/// Processor time of this thread: what else the machine does is not the task's.
double ThreadSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

GatheredTask GatherTask(const TaskSpec& task, Gatherer& gatherer) {
  const double begin = ThreadSeconds();
  GatheredTask gathered{gatherer.Gather(task.block), 0};
  gathered.seconds = ThreadSeconds() - begin;
  return gathered;
}

Status PublishTask(const TaskSpec& task, const GatheredTask& gathered, ChunkStore* store,
                   std::optional<uint32_t> home) {
  // A message that came twice may have had it computed twice at once; what is there is not touched.
  if (store->FindResult(task.key)) return {};
  return store->PutResult(task.key, SerializeBlock(gathered.result), {gathered.seconds, home}).status();
}

Status ComputeTask(const TaskSpec& task, Gatherer& gatherer, ChunkStore* store, WorkerMeter* meter,
                   std::optional<uint32_t> home) {
  GatheredTask gathered;
  {
    const MeteredSpan span(meter ? &meter->gather_seconds : nullptr);
    gathered = GatherTask(task, gatherer);
  }
  GLINT_RETURN_IF_ERROR(gatherer.status());
  if (meter) meter->rays += gathered.result.counters.rays;
  const MeteredSpan span(meter ? &meter->publish_seconds : nullptr);
  return PublishTask(task, gathered, store, home);
}

}  // namespace glint
