#pragma once

#include <memory>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/chunk.h"
#include "common/archive/lobe_codec.h"
#include "common/archive/slice_table.h"
#include "common/domain/bake_settings.h"
#include "worker/gather.h"

namespace glint {

/// A gathered layer of a whole scene, merged.
struct GatheredLayer {
  std::vector<std::vector<std::byte>> bytes;
  LayerViews views;

  /// Nested tables too are of the bake's default form here, which reads the same.
  GatheredLayer(const GatherInput& input, const BakeSettings& settings, const BlockResult& block, int layer) {
    const uint32_t entry_bytes = layer == 0 ? kDirectEntryBytes : kIndirectEntryBytes;
    const SlotLayout layout{static_cast<uint32_t>(input.domain.max_lobes()), settings.StoredLobes()};
    for (uint32_t slot = 0; slot < layout.count(); ++slot) {
      const bool diffuse = layout.is_diffuse(slot);
      const BlockRows& rows = block.slots[slot];
      SliceTableBuilder builder(input.domain.vertex_count(), diffuse ? 2 : input.grid.size(), entry_bytes);
      size_t first = 0;
      for (const uint16_t count : rows.counts) {
        builder.AppendRow(std::span(rows.columns).subspan(first, count),
                          std::span(rows.entries).subspan(first * entry_bytes, size_t{count} * entry_bytes));
        first += count;
      }
      bytes.push_back(builder.Finish());
      views.Add(slot / layout.stride(), diffuse, *SliceTableView::Parse(bytes.back()));
    }
    views.nested = input.grid.nested();
  }
};

/// Gathers the first `count` layers of a scene.
inline std::vector<std::unique_ptr<GatheredLayer>> GatherLayers(const GatherInput& input,
                                                                const BakeSettings& settings, int count) {
  const std::unique_ptr<Gatherer> gatherer = MakeGatherer(input, settings, uint64_t{1} << 28);
  std::vector<std::unique_ptr<GatheredLayer>> layers;
  for (int layer = 0; layer < count; ++layer) {
    gatherer->BeginLayer(layer, layer ? &layers.back()->views : nullptr, 1);
    const BlockResult block = gatherer->Gather({0, input.domain.vertex_count(), 0, input.grid.size()});
    layers.push_back(std::make_unique<GatheredLayer>(input, settings, block, layer));
  }
  return layers;
}

}  // namespace glint
