#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/chunk.h"
#include "common/archive/lobe_codec.h"
#include "common/domain/bake_settings.h"
#include "worker/path_fan.h"

namespace glint {

/// What a fan's light of a layer above 0 is stored as; empty if as nothing.
std::vector<IndirectLobe> ReadOutIndirect(const SliceLobe& lobe, const ReadOut& read_out, FanLight* light);

/// Slices of a few points and directions in the form in which an archive holds its own, so that a
/// TransferReader reads them by the same interpolation and with the same digits.
class ProbeTables {
 public:
  ProbeTables(int layers, int max_lobes, uint32_t columns, const ReadOut& read_out);

  void BeginRow();
  /// Adds one slot of one slice of the current row; columns come in order.
  /// @param slot      PathFanTracer::kDiffuse for the diffuse table
  /// @param indirect  light of each layer; layer 0's comes from the fan itself
  void Add(int slot, uint16_t column, const PathFan& fan, std::span<FanLight> indirect);

  /// A layer's tables, serialised, and views into them.
  struct LayerTables {
    std::vector<std::vector<std::byte>> bytes;
    LayerViews views;
  };
  LayerTables Finish(int layer) const;

 private:
  uint32_t columns_;
  ReadOut read_out_;
  SlotLayout indirect_layout_;
  std::vector<BlockResult> blocks_;  ///< of layers
};

}  // namespace glint
