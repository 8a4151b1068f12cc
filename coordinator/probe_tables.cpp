#include "coordinator/probe_tables.h"

#include "common/archive/lobe_codec.h"
#include "common/archive/slice_table.h"
#include "worker/slice_encoder.h"

namespace glint {
namespace {

constexpr uint32_t kSides = 2;  ///< columns of a diffuse table

}  // namespace

std::vector<std::byte> MakeTable(const BlockRows& rows, uint32_t columns, uint32_t entry_bytes) {
  SliceTableBuilder builder(static_cast<uint32_t>(rows.counts.size()), columns, entry_bytes);
  size_t entry = 0;
  for (const uint16_t count : rows.counts) {
    builder.AppendRow(std::span(rows.columns).subspan(entry, count),
                      std::span(rows.entries).subspan(entry * entry_bytes, count * entry_bytes));
    entry += count;
  }
  return builder.Finish();
}

ProbeTables::ProbeTables(int layers, int max_lobes, uint32_t columns, float drop)
    : columns_(columns), drop_(drop), blocks_(layers) {
  for (BlockResult& block : blocks_) block.slots.resize(static_cast<size_t>(max_lobes) + 1);
}

void ProbeTables::BeginRow() {
  for (BlockResult& block : blocks_)
    for (BlockRows& rows : block.slots) rows.BeginRow();
}

void ProbeTables::Add(int slot, uint16_t column, const PathFan& fan,
                      std::span<const IndirectMoments> indirect) {
  for (size_t layer = 0; layer < blocks_.size(); ++layer) {
    std::vector<BlockRows>& slots = blocks_[layer].slots;
    BlockRows* rows = slot == PathFanTracer::kDiffuse ? &slots.back() : &slots[slot];
    if (layer == 0) {
      StoreDirect(FitDirect(fan.lobe, DirectMomentsOf(fan), drop_), column, rows);
    } else {
      StoreIndirect(FitIndirect(fan.lobe, indirect[layer], drop_), column, rows);
    }
  }
}

ProbeTables::LayerTables ProbeTables::Finish(int layer) const {
  LayerTables tables;
  const std::vector<BlockRows>& slots = blocks_[layer].slots;
  const uint32_t entry_bytes = layer == 0 ? kDirectEntryBytes : kIndirectEntryBytes;
  for (const BlockRows& rows : slots)
    tables.bytes.push_back(MakeTable(rows, &rows == &slots.back() ? kSides : columns_, entry_bytes));
  for (const auto& bytes : tables.bytes) tables.views.specular.push_back(*SliceTableView::Parse(bytes));
  tables.views.diffuse = tables.views.specular.back();
  tables.views.specular.pop_back();
  return tables;
}

}  // namespace glint
