#pragma once

#include <array>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/chunk.h"
#include "common/domain/direction_grid.h"
#include "common/round/task.h"
#include "common/store/store.h"

namespace glint {

/// A merged layer: its tables, and how much light it carries.
struct Layer {
  std::vector<std::vector<std::byte>> slots;  ///< serialised tables: specular slots, then diffuse
  LayerViews views;                           ///< into `slots`
  Digest digest;  ///< of the rows, in whatever form; what the next layer's tasks depend on
  GatherCounters counters;
  double energy = 0;  ///< light of this layer under a uniform environment, relative to the unoccluded BRDFs'
  std::array<uint64_t, kMaxSliceLobes> stored{};  ///< slices with at least 1, 2, ... lobes

  Layer() = default;
  Layer(Layer&&) = default;
  Layer& operator=(Layer&&) = default;
  Layer(const Layer&) = delete;  // views point into slots
  Layer& operator=(const Layer&) = delete;
};

/// Joins the chunks of a round in the order of vertices and columns; the same whatever the partition was.
/// Entries get the fewest bytes that the settings' bits_tolerance allows, table by table.
/// Of a nested grid, compact tables are segmented. `tasks` are ordered by first vertex, then first column.
/// Chunks that are damaged are discarded from the store, all of them, and reported as kMismatch: the round
/// has to be run again. kIo: a chunk cannot be read.
Result<Layer> MergeLayer(ChunkStore& store, std::span<const TaskSpec> tasks, const BakeDomain& domain,
                         const DirectionGrid& grid, const BakeSettings& settings, TableForm form,
                         int threads);

}  // namespace glint
