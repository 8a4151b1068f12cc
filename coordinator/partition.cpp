#include "coordinator/partition.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/queue/shard.h"

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

/// How many tasks a shard is cut into.
size_t Parts(double total, double wanted, size_t vertices) {
  const double parts = wanted > 0 ? std::max(std::round(total / wanted), 1.0) : 1;
  const size_t most = wanted < kShortestTaskSeconds ? vertices / kFewestVertices : vertices;
  return static_cast<size_t>(std::min(parts, static_cast<double>(std::max<size_t>(most, 1))));
}

/// How many vertices each task of a shard has: parts that take alike, about as long as wanted.
std::vector<uint32_t> CutShard(std::span<const float> seconds, double wanted) {
  const double total = std::accumulate(seconds.begin(), seconds.end(), 0.0);
  const double part = total / static_cast<double>(Parts(total, wanted, seconds.size()));
  std::vector<uint32_t> lengths = {0};
  double taken = 0;
  for (const float s : seconds) {
    // To the next task, if more than half of the vertex would be over this one's end.
    if (lengths.back() > 0 && taken + 0.5 * s > part * static_cast<double>(lengths.size()))
      lengths.push_back(0);
    ++lengths.back();
    taken += s;
  }
  return lengths;
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
  const double wanted = TaskSeconds(std::accumulate(seconds.begin(), seconds.end(), 0.0));
  const auto vertices = static_cast<uint32_t>(seconds.size());
  const uint32_t shards = ShardsFor(vertices);
  std::vector<GatherBlock> blocks;
  uint32_t first = 0;
  for (uint32_t v = 0; v < vertices; ++v) {
    if (v + 1 < vertices && ShardOf(v, vertices, shards) == ShardOf(v + 1, vertices, shards)) continue;
    const std::span<const float> shard = seconds.subspan(first, v + 1 - first);
    for (const uint32_t length : CutShard(shard, wanted)) {
      AppendColumns(first, length, columns, columns_per_task, &blocks);
      first += length;
    }
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
