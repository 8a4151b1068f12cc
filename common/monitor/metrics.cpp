#include "common/monitor/metrics.h"

#include <sys/resource.h>

#include <charconv>

#include "common/base/memory.h"

namespace glint {
namespace {

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

double ProcessorSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return Seconds(usage.ru_utime) + Seconds(usage.ru_stime);
}

/// Backslash and line feed, and in a label's value the quotation mark, too.
std::string Escape(const std::string& text, bool quoted) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\n') {
      escaped += "\\n";
      continue;
    }
    if (c == '\\' || (quoted && c == '"')) escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::string ToText(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

std::string ToText(const std::string& name, const MetricSample& sample) {
  std::string labels;
  for (const auto& [label, value] : sample.labels)
    labels += (labels.empty() ? "{" : ",") + label + "=\"" + Escape(value, true) + "\"";
  if (!labels.empty()) labels += "}";
  return name + labels + " " + ToText(sample.value) + "\n";
}

}  // namespace

Metric SingleMetric(std::string name, MetricKind kind, std::string help, double value) {
  return {std::move(name), kind, std::move(help), {{{}, value}}};
}

std::vector<Metric> ProcessMetrics(const std::string& execution) {
  return {
      {"glint_build_info",
       MetricKind::kGauge,
       "Version, and what decides a result's bits here",
       {{{{"version", GLINT_VERSION}, {"execution", execution}}, 1}}},
      SingleMetric("process_cpu_seconds_total", MetricKind::kCounter, "Processor time", ProcessorSeconds()),
      SingleMetric("process_resident_memory_bytes", MetricKind::kGauge, "Memory that the process has",
                   static_cast<double>(ResidentMemory())),
      SingleMetric("glint_usable_memory_bytes", MetricKind::kGauge,
                   "Memory that the process may have: the machine's, or its control group's limit",
                   static_cast<double>(UsableMemory()))};
}

std::string ToPrometheus(std::span<const Metric> metrics) {
  std::string text;
  for (const Metric& metric : metrics) {
    text += "# HELP " + metric.name + " " + Escape(metric.help, false) + "\n";
    text += "# TYPE " + metric.name + (metric.kind == MetricKind::kCounter ? " counter" : " gauge") + "\n";
    for (const MetricSample& sample : metric.samples) text += ToText(metric.name, sample);
  }
  return text;
}

}  // namespace glint
