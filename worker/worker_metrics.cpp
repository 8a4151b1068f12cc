#include "worker/worker_metrics.h"

#include "worker/execution_id.h"

namespace glint {

std::vector<Metric> WorkerMetrics(const WorkerMeter& meter, int threads) {
  constexpr auto kCounter = MetricKind::kCounter;
  const auto number = [](uint64_t value) { return static_cast<double>(value); };
  std::vector<Metric> metrics = ProcessMetrics(ExecutionId());
  metrics.push_back({"glint_worker_tasks_total",
                     kCounter,
                     "Tasks that this worker had, by what became of them",
                     {{{{"outcome", "computed"}}, number(meter.computed)},
                      {{{"outcome", "found"}}, number(meter.found)},
                      {{{"outcome", "returned"}}, number(meter.returned)},
                      {{{"outcome", "given_up"}}, number(meter.given_up)}}});
  metrics.push_back(SingleMetric("glint_worker_redeliveries_total", kCounter,
                                 "Tasks that somebody had had before", number(meter.redelivered)));
  metrics.push_back(
      SingleMetric("glint_worker_rays_total", kCounter, "Rays traced for tasks", number(meter.rays)));
  metrics.push_back({"glint_worker_stage_seconds_total",
                     kCounter,
                     "Time of all threads on tasks, by stage",
                     {{{{"stage", "round"}}, meter.round_seconds},
                      {{{"stage", "gather"}}, meter.gather_seconds},
                      {{{"stage", "publish"}}, meter.publish_seconds}}});
  metrics.push_back({"glint_worker_own_threads",
                     MetricKind::kGauge,
                     "Threads of this worker, and those with a task",
                     {{{{"state", "all"}}, static_cast<double>(threads)},
                      {{{"state", "busy"}}, static_cast<double>(meter.busy)}}});
  return metrics;
}

}  // namespace glint
