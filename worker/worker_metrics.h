#pragma once

#include <vector>

#include "common/monitor/metrics.h"
#include "worker/worker_meter.h"

namespace glint {

/// What a worker of `threads` threads shows of itself (docs/operation.md).
std::vector<Metric> WorkerMetrics(const WorkerMeter& meter, int threads);

}  // namespace glint
