#include "coordinator/probe_tables.h"

#include "common/archive/lobe_codec.h"
#include "common/archive/slice_table.h"
#include "worker/slice_encoder.h"

namespace glint {
namespace {

constexpr uint32_t kSides = 2;  ///< columns of a diffuse table

std::vector<std::byte> MakeTable(const BlockRows& rows, uint32_t columns, const EntryPacking& pack,
                                 TableForm form) {
  SliceTableBuilder builder(static_cast<uint32_t>(rows.counts.size()), columns, pack.bytes);
  std::vector<std::byte> entries;
  size_t entry = 0;
  for (const uint16_t count : rows.counts) {
    entries.clear();
    for (size_t e = entry; e < entry + count; ++e)
      pack.Append(rows.entries.data() + e * kDirectEntryBytes, &entries);
    builder.AppendRow(std::span(rows.columns).subspan(entry, count), entries);
    entry += count;
  }
  return builder.Finish(form);
}

}  // namespace

std::vector<DirectLobe> ReadOutDirect(const PathFan& fan, const ReadOut& read_out) {
  const VisibleParts parts = DirectPartsOf(fan, read_out);
  std::vector<DirectLobe> lobes;
  lobes.reserve(static_cast<size_t>(parts.count));
  for (int i = 0; i < parts.count; ++i) lobes.push_back(DirectLobeOf(fan.lobe, parts.part[i]));
  if (!lobes.empty()) return lobes;
  const auto whole = FitDirect(fan.lobe, DirectMomentsOf(fan), read_out.drop);
  return whole ? std::vector<DirectLobe>{*whole} : std::vector<DirectLobe>{};
}

std::vector<IndirectLobe> ReadOutIndirect(const SliceLobe& lobe, const ReadOut& read_out, FanLight* light) {
  const IndirectMoments moments = light->Moments();
  std::vector<IndirectLobe> lobes;
  for (const LightGroup& group : SplitLight(SelectGatherKernels(), moments, light->leaving, lobe, read_out,
                                            [&] { return light->samples.List(); }))
    lobes.push_back(IndirectLobeOf(lobe, group.Moments()));
  if (lobes.size() > 1) return lobes;
  const auto whole = FitIndirect(lobe, moments, read_out.drop);
  return whole ? std::vector<IndirectLobe>{*whole} : std::vector<IndirectLobe>{};
}

ProbeTables::ProbeTables(int layers, int max_lobes, uint32_t columns, const ReadOut& read_out)
    : columns_(columns),
      never_absent_(columns),
      read_out_(read_out),
      layout_{static_cast<uint32_t>(max_lobes), static_cast<uint32_t>(read_out.slice_lobes)},
      blocks_(layers) {
  for (BlockResult& block : blocks_) block.slots.resize(layout_.count());
}

ProbeTables::ProbeTables(int layers, int max_lobes, const DirectionGrid& nested, const ReadOut& read_out)
    : ProbeTables(layers, max_lobes, nested.size(), read_out) {
  never_absent_ = DirectionGrid::SizeOf(nested.base_level());
  nested_ = true;
}

void ProbeTables::BeginRow() {
  for (BlockResult& block : blocks_)
    for (BlockRows& rows : block.slots) rows.BeginRow();
}

void ProbeTables::Add(int slot, uint16_t column, const PathFan& fan, std::span<FanLight> indirect,
                      std::span<const uint8_t> wanted) {
  const uint32_t first = slot == PathFanTracer::kDiffuse ? layout_.specular : static_cast<uint32_t>(slot);
  const bool said = slot != PathFanTracer::kDiffuse && column >= never_absent_;
  if (wanted[0]) {
    std::vector<DirectLobe> lobes = ReadOutDirect(fan, read_out_);
    if (lobes.empty() && said) lobes.emplace_back();
    BlockRows* rows = &blocks_[0].slots[first];
    for (const DirectLobe& lobe : lobes) {
      StoreDirect(lobe, column, rows);
      rows += layout_.stride();
    }
  }
  for (size_t layer = 1; layer < blocks_.size(); ++layer) {
    if (!wanted[layer]) continue;
    std::vector<IndirectLobe> lobes = ReadOutIndirect(fan.lobe, read_out_, &indirect[layer]);
    if (lobes.empty() && said) lobes.emplace_back();
    BlockRows* rows = &blocks_[layer].slots[first];
    for (const IndirectLobe& lobe : lobes) {
      StoreIndirect(lobe, column, rows);
      rows += layout_.stride();
    }
  }
}

ProbeTables::LayerTables ProbeTables::Finish(int layer, const LayerViews& like) const {
  LayerTables tables;
  const std::vector<BlockRows>& slots = blocks_[layer].slots;
  for (uint32_t slot = 0; slot < slots.size(); ++slot) {
    const bool diffuse = layout_.is_diffuse(slot);
    const uint32_t lobe = std::min(slot / layout_.stride(), like.lobes() - 1);
    const SliceTableView& table = like.table(lobe, slot % layout_.stride());
    tables.bytes.push_back(MakeTable(slots[slot], diffuse ? kSides : columns_,
                                     {layer == 0, table.entry_bytes()},
                                     nested_ && !diffuse ? TableForm::kSegmented : kDefaultTableForm));
  }
  tables.views.nested = nested_;
  for (uint32_t slot = 0; slot < slots.size(); ++slot)
    tables.views.Add(slot / layout_.stride(), layout_.is_diffuse(slot),
                     *SliceTableView::Parse(tables.bytes[slot]));
  return tables;
}

}  // namespace glint
