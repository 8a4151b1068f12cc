#include "coordinator/partition.h"

#include <algorithm>
#include <numeric>

namespace glint {
namespace {

void AppendColumns(uint32_t first, uint32_t vertices, uint32_t columns, uint32_t step,
                   std::vector<GatherBlock>* blocks) {
  for (uint32_t c = 0; c < columns; c += step)
    blocks->push_back({first, vertices, c, std::min(step, columns - c)});
}

double TaskSeconds(double total) {
  const double wanted = std::clamp(total / kWantedTasks, kShortestTaskSeconds, kLongestTaskSeconds);
  return std::min(wanted, total / kFewestTasks);
}

}  // namespace

std::vector<float> SpreadSeconds(std::span<const MeasuredBlock> blocks, uint32_t vertices) {
  std::vector<float> seconds(vertices, 0.0f);
  for (const auto& [block, took] : blocks) {
    const auto share = static_cast<float>(took / block.vertices);
    for (uint32_t v = 0; v < block.vertices; ++v) seconds[block.first_vertex + v] += share;
  }
  return seconds;
}

std::vector<GatherBlock> CutByCost(std::span<const float> seconds, uint32_t columns,
                                   uint32_t columns_per_task) {
  const double total = std::accumulate(seconds.begin(), seconds.end(), 0.0);
  const double wanted = TaskSeconds(total);
  const auto vertices = static_cast<uint32_t>(seconds.size());
  std::vector<GatherBlock> blocks;
  uint32_t first = 0;
  double taken = 0;
  for (uint32_t v = 0; v < vertices; ++v) {
    taken += seconds[v];
    const bool few = v + 1 - first < kFewestVertices && taken < kShortestTaskSeconds;
    if (v + 1 < vertices && (few || taken < wanted)) continue;
    AppendColumns(first, v + 1 - first, columns, columns_per_task, &blocks);
    first = v + 1;
    taken = 0;
  }
  return blocks;
}

std::vector<GatherBlock> CutEvenly(uint32_t vertices, uint32_t vertices_per_task, uint32_t columns,
                                   uint32_t columns_per_task) {
  std::vector<GatherBlock> blocks;
  for (uint32_t v = 0; v < vertices; v += vertices_per_task)
    AppendColumns(v, std::min(vertices_per_task, vertices - v), columns, columns_per_task, &blocks);
  return blocks;
}

}  // namespace glint
