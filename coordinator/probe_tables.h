#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/chunk.h"
#include "common/archive/lobe_codec.h"
#include "common/domain/bake_settings.h"
#include "common/domain/direction_grid.h"
#include "worker/path_fan.h"

namespace glint {

/// What is visible of a fan's lobe is stored as; empty if nothing blocks it.
std::vector<DirectLobe> ReadOutDirect(const PathFan& fan, const ReadOut& read_out);
/// What a fan's light of a layer above 0 is stored as; empty if as nothing.
std::vector<IndirectLobe> ReadOutIndirect(const SliceLobe& lobe, const ReadOut& read_out, FanLight* light);

/// Slices of a few points and directions in the form in which an archive holds its own, so that a
/// TransferReader reads them by the same interpolation and with the same digits.
class ProbeTables {
 public:
  ProbeTables(int layers, int max_lobes, uint32_t columns, const ReadOut& read_out);
  /// Nested tables, with a column for each direction of the grid.
  ProbeTables(int layers, int max_lobes, const DirectionGrid& nested, const ReadOut& read_out);

  void BeginRow();
  /// Adds one slot of one slice of the current row; columns come in order.
  /// @param slot      PathFanTracer::kDiffuse for the diffuse table
  /// @param indirect  light of each layer; layer 0's comes from the fan itself
  /// @param wanted    of each layer: whether its table gets the slice
  void Add(int slot, uint16_t column, const PathFan& fan, std::span<FanLight> indirect,
           std::span<const uint8_t> wanted);

  /// A layer's tables, serialised, and views into them.
  struct LayerTables {
    std::vector<std::vector<std::byte>> bytes;
    LayerViews views;
  };
  /// @param like  whose entries have as many bytes
  LayerTables Finish(int layer, const LayerViews& like) const;

 private:
  uint32_t columns_;
  uint32_t never_absent_;  ///< from this column on, slices that are free or dark are said to be so
  bool nested_ = false;
  ReadOut read_out_;
  SlotLayout layout_;
  std::vector<BlockResult> blocks_;  ///< of layers
};

}  // namespace glint
