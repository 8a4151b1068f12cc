#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/chunk.h"
#include "worker/path_fan.h"

namespace glint {

/// A table of these rows.
std::vector<std::byte> MakeTable(const BlockRows& rows, uint32_t columns, uint32_t entry_bytes);

/// Slices of a few points and directions in the form in which an archive holds its own, so that a
/// TransferReader reads them by the same interpolation and with the same digits.
class ProbeTables {
 public:
  /// @param drop  the bake's (BakeSettings)
  ProbeTables(int layers, int max_lobes, uint32_t columns, float drop);

  void BeginRow();
  /// Adds one slot of one slice of the current row; columns come in order.
  /// @param slot      PathFanTracer::kDiffuse for the diffuse table
  /// @param indirect  moments of each layer; layer 0's come from the fan itself
  void Add(int slot, uint16_t column, const PathFan& fan, std::span<const IndirectMoments> indirect);

  /// A layer's tables, serialised, and views into them.
  struct LayerTables {
    std::vector<std::vector<std::byte>> bytes;
    LayerViews views;
  };
  LayerTables Finish(int layer) const;

 private:
  uint32_t columns_;
  float drop_;
  std::vector<BlockResult> blocks_;  ///< of layers
};

}  // namespace glint
