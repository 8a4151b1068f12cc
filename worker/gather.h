#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "common/archive/archive.h"
#include "common/archive/chunk.h"
#include "common/base/status.h"
#include "common/domain/bake_domain.h"
#include "common/domain/bake_settings.h"
#include "common/domain/direction_grid.h"
#include "common/scene/ray_scene.h"

namespace glint {

/// Part of every task's key: raised whenever a change to gathering, or to which vertices are baked, changes
/// results, so that chunks of an older program are not taken for this one's.
inline constexpr int kGatherRevision = 9;

/// Gathers one layer, block by block. Implementations are pure functions of (domain, rays, settings, previous
/// layer, block): any partition into blocks gives the same slices.
class Gatherer {
 public:
  virtual ~Gatherer() = default;
  /// Turns to a layer, before its first block.
  /// @param layer     0: direct light; above: gathers `previous`, the tables of layer - 1
  /// @param row_sums  none: the tables are sound; they are unpacked at once, and needed no longer. Else
  /// RowSum
  ///                  of each row: rows are read, and compared, as rays reach them, until the next layer
  virtual void BeginLayer(int layer, const LayerViews* previous, int threads,
                          std::span<const uint64_t> row_sums) = 0;
  void BeginLayer(int layer, const LayerViews* previous, int threads) {
    BeginLayer(layer, previous, threads, {});
  }
  /// Thread-safe within a layer.
  virtual BlockResult Gather(const GatherBlock& block) = 0;
  /// kBadInput: what was gathered since BeginLayer is wrong, as a row of the layer before is damaged.
  virtual Status status() const = 0;
};

/// What gatherers need of a scene; outlives them.
struct GatherInput {
  const BakeDomain& domain;
  const RayScene& rays;
  const DirectionGrid& grid;
};

/// @param memory_bytes  kShared: bound on hit sets kept between layers; sets that do not fit are traced again
std::unique_ptr<Gatherer> MakeGatherer(const GatherInput& input, const BakeSettings& settings,
                                       uint64_t memory_bytes);

/// Name of the instruction-set level that the gather kernels run at here ("avx2"); part of every task's key.
const char* GatherKernelLevel();

}  // namespace glint
