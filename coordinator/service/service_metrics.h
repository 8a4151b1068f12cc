#pragma once

#include <vector>

#include "common/monitor/metrics.h"
#include "common/queue/task_queue.h"
#include "coordinator/service/bake_service.h"

namespace glint {

/// What a service shows of itself (docs/operation.md).
/// @param queue  that its workers listen to, asked about each bake at work; null: it has none
std::vector<Metric> ServiceMetrics(const BakeService& service, TaskPublisher* queue);

}  // namespace glint
