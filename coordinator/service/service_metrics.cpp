#include "coordinator/service/service_metrics.h"

#include <array>
#include <optional>
#include <system_error>

#include "worker/execution_id.h"

namespace glint {
namespace {

constexpr auto kCounter = MetricKind::kCounter;
constexpr auto kGauge = MetricKind::kGauge;

double Number(uint64_t value) { return static_cast<double>(value); }

MetricSample Sample(const char* label, const std::string& value, double number) {
  return {{{label, value}}, number};
}

Metric Bakes(const std::vector<BakeStatus>& bakes) {
  constexpr std::array<std::pair<const char*, BakeState>, 5> kStates = {
      {{"queued", BakeState::kQueued},
       {"running", BakeState::kRunning},
       {"done", BakeState::kDone},
       {"failed", BakeState::kFailed},
       {"cancelled", BakeState::kCancelled}}};
  Metric metric{"glint_bakes", kGauge, "Bakes in the journal, by state", {}};
  for (const auto& [name, state] : kStates) {
    double count = 0;
    for (const BakeStatus& bake : bakes) count += bake.entry.state == state;
    metric.samples.push_back(Sample("state", name, count));
  }
  return metric;
}

Metric StageSeconds(const ServiceCounts& counts) {
  Metric metric{"glint_stage_seconds_total", kCounter, "Time spent on bakes, by stage", {}};
  for (const auto& [stage, seconds] : counts.stage_seconds)
    metric.samples.push_back(Sample("stage", stage, seconds));
  return metric;
}

void AddStore(const BakeService& service, std::vector<Metric>* metrics) {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(service.store(), error);
  if (!error)
    metrics->push_back(SingleMetric("glint_store_free_bytes", kGauge, "Room in the store's file system",
                                    Number(space.available)));
  metrics->push_back(SingleMetric("glint_store_collected_bytes_total", kCounter,
                                  "Removed from the store because no bake needed it",
                                  Number(service.Counts().collected_bytes)));
}

/// Of all bakes at work; none: the queue does not answer.
std::optional<QueueState> AddUp(const std::vector<BakeStatus>& bakes, TaskPublisher* queue) {
  QueueState sum;
  for (const BakeStatus& bake : bakes) {
    const std::optional<Digest> key = Digest::FromHex(bake.entry.bake_key);
    if (bake.entry.state != BakeState::kRunning || !key) continue;
    const Result<std::optional<QueueState>> state = queue->State(*key);
    if (!state.ok()) return std::nullopt;
    if (!*state) continue;
    sum.waiting += (*state)->waiting;
    sum.in_flight += (*state)->in_flight;
    sum.requests += (*state)->requests;
    sum.redelivered += (*state)->redelivered;
  }
  return sum;
}

void AddQueue(const std::vector<BakeStatus>& bakes, TaskPublisher* queue, std::vector<Metric>* metrics) {
  const std::optional<QueueState> state = AddUp(bakes, queue);
  metrics->push_back(SingleMetric("glint_queue_up", kGauge, "Whether the queue answers", state ? 1 : 0));
  if (!state) return;
  metrics->push_back({"glint_queue_tasks",
                      kGauge,
                      "Tasks of bakes at work, by where they are",
                      {Sample("state", "waiting", Number(state->waiting)),
                       Sample("state", "in_flight", Number(state->in_flight))}});
  metrics->push_back(SingleMetric("glint_queue_redelivered_tasks", kGauge,
                                  "Tasks in flight that somebody had before", Number(state->redelivered)));
  metrics->push_back({"glint_worker_threads",
                      kGauge,
                      "Workers' threads on bakes at work: with a task, or asking for one",
                      {Sample("state", "busy", Number(state->in_flight)),
                       Sample("state", "asking", Number(state->requests))}});
}

}  // namespace

std::vector<Metric> ServiceMetrics(const BakeService& service, TaskPublisher* queue) {
  const std::vector<BakeStatus> bakes = service.List();
  const ServiceCounts counts = service.Counts();
  std::vector<Metric> metrics = ProcessMetrics(ExecutionId());
  metrics.push_back(Bakes(bakes));
  metrics.push_back({"glint_tasks_total",
                     kCounter,
                     "Tasks of bakes that were done, by whether their results were there",
                     {Sample("outcome", "computed", Number(counts.tasks_computed)),
                      Sample("outcome", "found", Number(counts.tasks_found))}});
  metrics.push_back(
      SingleMetric("glint_rays_total", kCounter, "Rays of layers that were merged", Number(counts.rays)));
  metrics.push_back(StageSeconds(counts));
  AddStore(service, &metrics);
  if (queue) AddQueue(bakes, queue, &metrics);
  return metrics;
}

}  // namespace glint
