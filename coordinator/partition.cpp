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

double Total(std::span<const VertexWork> work) {
  return std::accumulate(work.begin(), work.end(), 0.0,
                         [](double sum, const VertexWork& w) { return sum + w.seconds; });
}

/// How many tasks a run of vertices is cut into.
size_t Parts(double total, double wanted, size_t vertices) {
  const double parts = wanted > 0 ? std::max(std::round(total / wanted), 1.0) : 1;
  const size_t most = wanted < kShortestTaskSeconds ? vertices / kFewestVertices : vertices;
  return static_cast<size_t>(std::min(parts, static_cast<double>(std::max<size_t>(most, 1))));
}

/// How many vertices each task of a run has: parts that take alike, about as long as wanted.
std::vector<uint32_t> CutRun(std::span<const VertexWork> run, double wanted) {
  const double total = Total(run);
  const double part = total / static_cast<double>(Parts(total, wanted, run.size()));
  std::vector<uint32_t> lengths = {0};
  double taken = 0;
  for (const VertexWork& vertex : run) {
    // To the next task, if more than half of the vertex would be over this one's end.
    if (lengths.back() > 0 && taken + 0.5 * vertex.seconds > part * static_cast<double>(lengths.size()))
      lengths.push_back(0);
    ++lengths.back();
    taken += vertex.seconds;
  }
  return lengths;
}

}  // namespace

std::vector<VertexWork> SpreadWork(std::span<const MeasuredBlock> blocks, uint32_t vertices) {
  std::vector<VertexWork> work(vertices);
  for (const auto& [block, seconds, home] : blocks) {
    const auto share = static_cast<float>(seconds / block.vertices);
    for (uint32_t v = block.first_vertex; v < block.first_vertex + block.vertices; ++v) {
      work[v].seconds += share;
      work[v].home = home;
    }
  }
  return work;
}

std::vector<GatherBlock> CutByCost(std::span<const VertexWork> work, uint32_t columns,
                                   uint32_t columns_per_task) {
  const double wanted = TaskSeconds(Total(work));
  const auto vertices = static_cast<uint32_t>(work.size());
  const uint32_t shards = ShardsFor(vertices);
  const auto together = [&](uint32_t v, uint32_t w) {
    return ShardOf(v, vertices, shards) == ShardOf(w, vertices, shards) && work[v].home == work[w].home;
  };
  std::vector<GatherBlock> blocks;
  uint32_t first = 0;
  for (uint32_t v = 0; v < vertices; ++v) {
    if (v + 1 < vertices && together(v, v + 1)) continue;
    for (const uint32_t length : CutRun(work.subspan(first, v + 1 - first), wanted)) {
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
