#include "coordinator/probe_tables.h"

#include "common/archive/lobe_codec.h"
#include "common/archive/slice_table.h"
#include "worker/slice_encoder.h"

namespace glint {
namespace {

constexpr uint32_t kSides = 2;  ///< columns of a diffuse table

std::vector<std::byte> MakeTable(const BlockRows& rows, uint32_t columns, uint32_t entry_bytes,
                                 TableForm form) {
  SliceTableBuilder builder(static_cast<uint32_t>(rows.counts.size()), columns, entry_bytes);
  size_t entry = 0;
  for (const uint16_t count : rows.counts) {
    builder.AppendRow(std::span(rows.columns).subspan(entry, count),
                      std::span(rows.entries).subspan(entry * entry_bytes, count * entry_bytes));
    entry += count;
  }
  return builder.Finish(form);
}

}  // namespace

ProbeTables::ProbeTables(int layers, int max_lobes, uint32_t columns, float drop)
    : columns_(columns), never_absent_(columns), drop_(drop), blocks_(layers) {
  for (BlockResult& block : blocks_) block.slots.resize(static_cast<size_t>(max_lobes) + 1);
}

ProbeTables::ProbeTables(int layers, int max_lobes, const DirectionGrid& nested, float drop)
    : ProbeTables(layers, max_lobes, nested.size(), drop) {
  never_absent_ = DirectionGrid::SizeOf(nested.base_level());
  nested_ = true;
}

void ProbeTables::BeginRow() {
  for (BlockResult& block : blocks_)
    for (BlockRows& rows : block.slots) rows.BeginRow();
}

void ProbeTables::Add(int slot, uint16_t column, const PathFan& fan,
                      std::span<const IndirectMoments> indirect, std::span<const uint8_t> wanted) {
  const bool absent = slot == PathFanTracer::kDiffuse || column < never_absent_;
  for (size_t layer = 0; layer < blocks_.size(); ++layer) {
    if (!wanted[layer]) continue;
    std::vector<BlockRows>& slots = blocks_[layer].slots;
    BlockRows* rows = slot == PathFanTracer::kDiffuse ? &slots.back() : &slots[slot];
    if (layer == 0) {
      auto lobe = FitDirect(fan.lobe, DirectMomentsOf(fan), drop_);
      if (!lobe && !absent) lobe.emplace();
      StoreDirect(lobe, column, rows);
    } else {
      auto lobe = FitIndirect(fan.lobe, indirect[layer], drop_);
      if (!lobe && !absent) lobe.emplace();
      StoreIndirect(lobe, column, rows);
    }
  }
}

ProbeTables::LayerTables ProbeTables::Finish(int layer) const {
  LayerTables tables;
  const std::vector<BlockRows>& slots = blocks_[layer].slots;
  const uint32_t entry_bytes = layer == 0 ? kDirectEntryBytes : kIndirectEntryBytes;
  for (const BlockRows& rows : slots) {
    const bool diffuse = &rows == &slots.back();
    tables.bytes.push_back(MakeTable(rows, diffuse ? kSides : columns_, entry_bytes,
                                     nested_ && !diffuse ? TableForm::kSegmented : kDefaultTableForm));
  }
  tables.views.nested = nested_;
  for (const auto& bytes : tables.bytes) tables.views.specular.push_back(*SliceTableView::Parse(bytes));
  tables.views.diffuse = tables.views.specular.back();
  tables.views.specular.pop_back();
  return tables;
}

}  // namespace glint
