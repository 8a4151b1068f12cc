#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

namespace glint {

enum class MetricKind { kCounter, kGauge };

struct MetricSample {
  std::vector<std::pair<std::string, std::string>> labels;  ///< name, value
  double value = 0;
};

/// A quantity that a running program shows, and its values by label.
struct Metric {
  std::string name;  ///< by Prometheus's rules: a unit at the end, "_total" for counters
  MetricKind kind = MetricKind::kGauge;
  std::string help;
  std::vector<MetricSample> samples;
};

/// A quantity with one value.
Metric SingleMetric(std::string name, MetricKind kind, std::string help, double value);

/// Of this process: version, processor time, memory that it has and may have.
/// @param execution  ExecutionId()
std::vector<Metric> ProcessMetrics(const std::string& execution);

/// Prometheus's text format, version 0.0.4.
std::string ToPrometheus(std::span<const Metric> metrics);

}  // namespace glint
