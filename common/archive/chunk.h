#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/base/status.h"
#include "common/domain/bake_settings.h"

namespace glint {

/// Sparse rows of one table for a block: row i (of `counts.size()`) has counts[i] columns, in order.
struct BlockRows {
  std::vector<uint16_t> counts;
  std::vector<uint16_t> columns;
  std::vector<std::byte> entries;  ///< columns.size() entries of the layer's size

  void BeginRow() { counts.push_back(0); }
  /// Room for one more entry of the current row.
  std::byte* AddEntry(uint16_t column, uint32_t entry_bytes) {
    ++counts.back();
    columns.push_back(column);
    entries.resize(entries.size() + entry_bytes);
    return entries.data() + entries.size() - entry_bytes;
  }
};

/// Work done, for the report: only what is the same however the work was spread over tasks, threads and
/// restarts.
struct GatherCounters {
  uint64_t rays =
      0;  ///< traced for the first time (a hit set that had to be traced again is not counted again)
  uint64_t slices = 0;  ///< computed, stored or not

  GatherCounters& operator+=(const GatherCounters& o) {
    rays += o.rays;
    slices += o.slices;
    return *this;
  }
};

/// A task's result: one BlockRows per specular slot, then the diffuse one; then the same for the second lobes
/// of slices, and so on.
struct BlockResult {
  std::vector<BlockRows> slots;
  GatherCounters counters;
};

/// How a layer's tables are counted: `specular` slots and a diffuse one for each of `slice_lobes` lobes.
struct SlotLayout {
  uint32_t specular = 0, slice_lobes = 1;

  uint32_t stride() const { return specular + 1; }
  uint32_t count() const { return stride() * slice_lobes; }
  bool is_diffuse(uint32_t slot) const { return slot % stride() == specular; }
};

/// Bytes of a chunk's payload (docs/archive-format.md, "Chunks").
std::vector<std::byte> SerializeBlock(const BlockResult& result);
/// Checks sizes, counts and columns against the block and the layout; entries of `entry_bytes`. kBadInput.
Result<BlockResult> ParseBlock(std::span<const std::byte> bytes, const GatherBlock& block,
                               const SlotLayout& layout, uint32_t entry_bytes);

}  // namespace glint
