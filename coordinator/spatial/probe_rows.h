#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/chunk.h"
#include "common/archive/transfer.h"
#include "common/domain/direction_grid.h"
#include "coordinator/executor.h"
#include "coordinator/sky_light.h"
#include "coordinator/spatial/vertex_hierarchy.h"

namespace glint {

/// Slices of nodes of which it is not known yet whether they are to be baked, for some of the view
/// directions: the direct layer, and the first indirect one as if nothing blocked the light of what the rays
/// meet, which needs no other node's. Computed by an executor, round by round.
class ProbeRows {
 public:
  /// What rounds are run with; outlives it. `domain` has its nodes changed by every round.
  struct Input {
    BakeDomain* domain;
    const DirectionGrid& grid;
    const BakeSettings& settings;
    Digest bake_key;
    ChunkStore* store;
    Executor* executor;
    int threads;
    uint32_t vertices_per_task;
  };
  explicit ProbeRows(const Input& input);

  /// One round: computes these nodes (ascending, not computed before). Then they can be asked about.
  Status Compute(std::span<const uint32_t> nodes);
  /// Square of the relative error of the node's radiance when predicted from these, all of them computed: the
  /// mean over view directions and skies of (p - c)^2 / ((p^2 + c^2) / 2 + epsilon^2), as the estimate of an
  /// archive's error has it. Thread-safe.
  double SquareError(uint32_t node, std::span<const Parent> prediction) const;
  /// Nothing reaches the node: it sees neither the outside nor what sends light.
  bool Dark(uint32_t node) const { return dark_[row_of_[node]] != 0; }
  size_t computed() const { return nodes_.size(); }

 private:
  static constexpr int kLayers = 2;
  /// About as many directions are enough to tell whether a prediction is good.
  static constexpr uint32_t kDirections = 48;

  SlotLayout LayoutOf(int layer) const;
  Result<Layer> RunLayer(int layer);
  void Append(int layer, const LayerViews& views);
  Status FinishTables();
  bool FindDark(uint32_t row) const;
  SkyLight Light(const SurfacePlace& place, const glm::vec3& wo, std::span<const RowWeight> rows,
                 const std::vector<LobeSky>& skies, bool* defined) const;
  void FindEpsilon(std::span<const uint32_t> nodes);
  SurfacePlace PlaceOf(uint32_t node) const;

  const Input input_;
  const uint32_t column_step_;
  std::vector<SurfacePlace> vertex_place_;            ///< of each vertex: one of its triangles' corners
  std::vector<uint32_t> nodes_;                       ///< of rows
  std::vector<uint32_t> row_of_;                      ///< of nodes
  std::vector<uint8_t> dark_;                         ///< of rows
  std::array<std::vector<BlockRows>, kLayers> rows_;  ///< [layer][slot]
  std::array<std::vector<std::vector<std::byte>>, kLayers> tables_;
  std::array<LayerViews, kLayers> views_;
  std::unique_ptr<TransferReader> reader_;
  double epsilon_ = 0;
};

}  // namespace glint
