#include "coordinator/layer.h"

#include <algorithm>
#include <cstring>
#include <glm/geometric.hpp>
#include <numeric>
#include <string>
#include <utility>

#include "common/archive/entry_light.h"
#include "common/archive/lobe_codec.h"
#include "common/archive/nested.h"
#include "common/base/frame.h"
#include "common/base/parallel.h"

namespace glint {
namespace {

static_assert(kDirectEntryBytes == kIndirectEntryBytes, "tasks write entries of one size");

Result<BlockResult> ReadChunk(ChunkStore& store, const TaskSpec& task, const SlotLayout& layout,
                              uint32_t entry_bytes) {
  const std::optional<Digest> digest = store.FindResult(task.key);
  if (!digest)
    return Mismatch("the result of task " + task.key.Hex() + " has vanished from " + store.root().string());
  auto parse = [&]() -> Result<BlockResult> {
    GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> payload, store.Get(*digest));
    return ParseBlock(payload, task.block, layout, entry_bytes);
  };
  Result<BlockResult> block = parse();
  if (block.ok() || block.status().kind() == ErrorKind::kIo) return block;
  GLINT_RETURN_IF_ERROR(store.Discard(task.key, *digest));
  return Mismatch(block.status().message());
}

/// The blocks of all tasks. Chunks that are damaged are discarded, every one of them, before kMismatch is
/// returned: one more run then mends them all.
Result<std::vector<BlockResult>> ReadChunks(ChunkStore& store, std::span<const TaskSpec> tasks,
                                            const SlotLayout& layout, uint32_t entry_bytes, int threads) {
  std::vector<BlockResult> blocks(tasks.size());
  std::vector<Status> status(tasks.size());
  ParallelFor(tasks.size(), threads, 1, [&](size_t i, int) {
    Result<BlockResult> block = ReadChunk(store, tasks[i], layout, entry_bytes);
    if (block.ok()) {
      blocks[i] = std::move(block).value();
    } else {
      status[i] = block.status();
    }
  });
  Status damage;
  for (const Status& s : status) {
    if (!s.ok() && s.kind() != ErrorKind::kMismatch) return s;
    if (!s.ok()) damage = s;
  }
  GLINT_RETURN_IF_ERROR(damage);
  return blocks;
}

/// Square of what rounding an entry to fewer bits does to its light.
float RoundingError2(const std::byte* entry, bool direct, uint32_t bytes) {
  std::byte packed[kDirectEntryBytes];
  direct ? PackDirect(entry, bytes, packed) : PackIndirect(entry, bytes, packed);
  return direct ? Distance2(LightOf(DecodeDirect(entry)), LightOf(DecodeDirect(packed, bytes)))
                : Distance2(LightOf(DecodeIndirect(entry)), LightOf(DecodeIndirect(packed, bytes)));
}

/// The fewest bytes of an entry with which a slot's slices are off by at most the tolerance (rms), relative
/// to their unoccluded lobes. Every few vertices tell; sums are of integers, the same for any partition.
uint32_t ChooseEntryBytes(std::span<const TaskSpec> tasks, std::span<const BlockResult> blocks, uint32_t slot,
                          bool direct, uint32_t vertices, float tolerance) {
  constexpr uint32_t kVertices = 1024;
  constexpr double kFixed = 0x1p32, kMost = 16;  // room for 2^28 entries
  const uint32_t stride = std::max(vertices / kVertices, 1u);
  if (tolerance <= 0) return kDirectEntryBytes;
  for (const uint32_t bytes : kEntryBytes) {
    if (bytes == kDirectEntryBytes) break;
    uint64_t sum = 0, entries = 0;
    for (size_t b = 0; b < blocks.size(); ++b) {
      const BlockRows& rows = blocks[b].slots[slot];
      size_t begin = 0;
      for (uint32_t row = 0; row < rows.counts.size(); begin += rows.counts[row++]) {
        if ((tasks[b].block.first_vertex + row) % stride != 0) continue;
        entries += rows.counts[row];
        for (size_t e = begin; e < begin + rows.counts[row]; ++e) {
          const float error2 = RoundingError2(rows.entries.data() + e * kDirectEntryBytes, direct, bytes);
          sum += static_cast<uint64_t>(kFixed * std::min(double{error2}, kMost));
        }
      }
    }
    const double most = kFixed * double{tolerance} * double{tolerance} * static_cast<double>(entries);
    if (static_cast<double>(sum) <= most) return bytes;
  }
  return kDirectEntryBytes;
}

/// Rounds entries that a task wrote to those of a table, in their place.
void PackEntries(const EntryPacking& pack, std::vector<std::byte>* entries) {
  if (pack.bytes == kDirectEntryBytes) return;
  const size_t count = entries->size() / kDirectEntryBytes;
  std::byte* const data = entries->data();
  for (size_t e = 0; e < count; ++e) {
    std::byte entry[kDirectEntryBytes];
    std::memcpy(entry, data + e * kDirectEntryBytes, sizeof entry);
    std::byte* const out = data + e * pack.bytes;
    pack.direct ? PackDirect(entry, pack.bytes, out) : PackIndirect(entry, pack.bytes, out);
  }
  entries->resize(count * pack.bytes);
}

/// The direction blocks of one block of vertices: rows side by side.
void AppendBlocks(std::span<const BlockResult> blocks, uint32_t slot, uint32_t vertices, uint32_t entry_bytes,
                  SliceTableBuilder* builder) {
  std::vector<uint16_t> columns;
  std::vector<std::byte> entries;
  std::vector<size_t> next(blocks.size(), 0);
  for (uint32_t row = 0; row < vertices; ++row) {
    columns.clear();
    entries.clear();
    for (size_t b = 0; b < blocks.size(); ++b) {
      const BlockRows& rows = blocks[b].slots[slot];
      if (rows.counts.empty()) continue;
      const size_t begin = next[b], end = begin + rows.counts[row];
      columns.insert(columns.end(), rows.columns.begin() + begin, rows.columns.begin() + end);
      entries.insert(entries.end(), rows.entries.begin() + begin * entry_bytes,
                     rows.entries.begin() + end * entry_bytes);
      next[b] = end;
    }
    builder->AppendRow(columns, entries);
  }
}

/// One slot's table of all blocks, which are emptied on the way: a layer is not held twice.
std::vector<std::byte> BuildTable(std::span<const TaskSpec> tasks, std::span<BlockResult> blocks,
                                  uint32_t slot, uint32_t columns, uint32_t rows, uint32_t entry_bytes,
                                  TableForm form) {
  SliceTableBuilder builder(rows, columns, entry_bytes);
  size_t entries = 0;
  for (const BlockResult& block : blocks) entries += block.slots[slot].columns.size();
  builder.Reserve(entries);
  for (size_t first = 0, last = 0; first < tasks.size(); first = last) {
    const GatherBlock& block = tasks[first].block;
    while (last < tasks.size() && tasks[last].block.first_vertex == block.first_vertex) ++last;
    const std::span<BlockResult> joined = blocks.subspan(first, last - first);
    AppendBlocks(joined, slot, block.vertices, entry_bytes, &builder);
    for (BlockResult& done : joined) done.slots[slot] = {};
  }
  return builder.Finish(form);
}

/// Light of one vertex's slices under a uniform environment, summed over directions, lobes and sides.
struct VertexEnergy {
  double layer = 0, unoccluded = 0;
};

/// Part of the BRDF's light that a vertex's slices of one slot have, for each column.
/// @param layer_index  0: a missing entry is the whole BRDF; else nothing
std::vector<float> SliceParts(const LayerViews& views, uint32_t slot, int layer_index, uint32_t v) {
  std::vector<float> parts(views.table(0, slot).columns(), layer_index == 0 ? 1.0f : 0.0f);
  for (uint32_t lobe = 0; lobe < views.lobes(); ++lobe) {
    const SliceTableView& table = views.table(lobe, slot);
    table.Row(v).ForEach([&](uint32_t column, const std::byte* entry) {
      if (lobe == 0) parts[column] = 0;
      parts[column] += layer_index == 0 ? DecodeDirect(entry, table.entry_bytes()).fraction
                                        : Luminance(DecodeIndirect(entry, table.entry_bytes()).alpha);
    });
  }
  return parts;
}

/// Fills in the parts of slices that a nested table leaves out.
void Predict(const glm::vec3& normal, const DirectionGrid& grid, const SliceTableView& table, uint32_t v,
             std::vector<float>* parts) {
  const SliceTableView::RowView row = table.Row(v);
  if (row.empty()) return;
  for (const float side : {1.0f, -1.0f})
    ForEachPredicted(
        grid, [&](uint32_t d) { return side * glm::dot(normal, grid.direction(d)) > 0; },
        [&](uint32_t d) { return row.Find(d) != nullptr; },
        [&](uint32_t d, const std::array<uint32_t, 2>& ends, const std::array<float, 2>& share) {
          (*parts)[d] = share[0] * (*parts)[ends[0]] + share[1] * (*parts)[ends[1]];
        });
}

VertexEnergy MeasureVertex(const BakeDomain& domain, const DirectionGrid& grid, const LayerViews& views,
                           int layer_index, uint32_t v) {
  VertexEnergy energy;
  const BakeVertex vertex = domain.Row(v);
  const BrdfShape& shape = domain.shapes[vertex.shape];
  const Brdf brdf = domain.BrdfOf(vertex);
  auto add = [&](double part, double weight) {
    energy.unoccluded += weight;
    energy.layer += weight * part;
  };
  std::vector<std::vector<float>> parts;
  for (uint32_t slot = 0; slot <= views.diffuse_slot(); ++slot) {
    parts.push_back(SliceParts(views, slot, layer_index, v));
    if (views.nested && slot < views.diffuse_slot())
      Predict(vertex.normal, grid, views.specular[slot], v, &parts[slot]);
  }
  for (uint32_t column = 0; column < grid.size(); ++column) {
    const float cosine = glm::dot(vertex.normal, grid.direction(column));
    if (cosine <= 0 && !vertex.double_sided) continue;
    const BrdfSlice slice = LookupSlice(shape, std::abs(cosine));
    for (int k = 0; k < slice.lobes; ++k)
      add(parts[k][column], Luminance(slice.lobe[k].Weight(vertex.specular)));
    const float diffuse = Luminance(DiffuseAlbedo(brdf, std::abs(cosine)));
    if (diffuse > 0) add(parts.back()[cosine > 0 ? 0 : 1], diffuse);
  }
  return energy;
}

/// Relative light of a layer; summed in the order of vertices, so that it has one value for any number of
/// threads.
double MeasureEnergy(const BakeDomain& domain, const DirectionGrid& grid, const LayerViews& views,
                     int layer_index, int threads) {
  constexpr uint32_t kStride = 4;
  std::vector<VertexEnergy> energy((domain.row_count() + kStride - 1) / kStride);
  ParallelFor(energy.size(), threads, 64, [&](size_t i, int) {
    energy[i] = MeasureVertex(domain, grid, views, layer_index, kStride * static_cast<uint32_t>(i));
  });
  VertexEnergy total;
  for (const VertexEnergy& e : energy) total.layer += e.layer, total.unoccluded += e.unoccluded;
  return total.unoccluded > 0 ? total.layer / total.unoccluded : 0;
}

/// Hashes what a table holds, which is the same in every form.
void HashRows(const SliceTableView& table, Hasher* hasher) {
  hasher->Add(table.rows()).Add(table.columns()).Add(table.entry_bytes());
  std::vector<uint32_t> columns;
  std::vector<std::byte> entries;
  for (uint32_t row = 0; row < table.rows(); ++row) {
    columns.clear();
    entries.clear();
    table.Row(row).ForEach([&](uint32_t column, const std::byte* entry) {
      columns.push_back(column);
      entries.insert(entries.end(), entry, entry + table.entry_bytes());
    });
    hasher->Array(std::span<const uint32_t>(columns)).Bytes(entries);
  }
}

}  // namespace

Result<Layer> MergeLayer(ChunkStore& store, std::span<const TaskSpec> tasks, const BakeDomain& domain,
                         const DirectionGrid& grid, const BakeSettings& settings, TableForm form,
                         int threads) {
  const int layer_index = tasks.front().layer;
  const SlotLayout layout{static_cast<uint32_t>(domain.max_lobes()), settings.StoredLobes()};
  const uint32_t slots = layout.count();
  GLINT_ASSIGN_OR_RETURN(std::vector<BlockResult> blocks,
                         ReadChunks(store, tasks, layout, kDirectEntryBytes, threads));
  Layer layer;
  layer.views.nested = grid.nested();
  for (const BlockResult& block : blocks) layer.counters += block.counters;
  layer.slots.resize(slots);
  const TableForm nested = form == TableForm::kCompact ? TableForm::kSegmented : form;
  // Scenes with one lobe have one table to speak of: most of the work is spread over blocks, not slots.
  std::vector<EntryPacking> packing(slots);
  ParallelFor(slots, threads, 1, [&](size_t i, int) {
    const auto slot = static_cast<uint32_t>(i);
    // Diffuse entries are few, and their light is broad: a bias would show.
    const float tolerance = layout.is_diffuse(slot) ? 0 : settings.bits_tolerance;
    const bool direct = layer_index == 0;
    packing[i] = {direct, ChooseEntryBytes(tasks, blocks, slot, direct, domain.row_count(), tolerance)};
  });
  ParallelFor(blocks.size(), threads, 1, [&](size_t b, int) {
    for (uint32_t slot = 0; slot < slots; ++slot) PackEntries(packing[slot], &blocks[b].slots[slot].entries);
  });
  ParallelFor(slots, threads, 1, [&](size_t i, int) {
    const auto slot = static_cast<uint32_t>(i);
    const bool specular = !layout.is_diffuse(slot);
    layer.slots[slot] = BuildTable(tasks, blocks, slot, specular ? grid.size() : 2, domain.row_count(),
                                   packing[i].bytes, grid.nested() && specular ? nested : form);
  });
  Hasher hasher;
  for (uint32_t slot = 0; slot < slots; ++slot) {
    GLINT_ASSIGN_OR_RETURN(SliceTableView view, SliceTableView::Parse(layer.slots[slot]));
    const uint32_t lobe = slot / layout.stride();
    layer.stored[lobe] += view.entries();
    HashRows(view, &hasher);
    layer.views.Add(lobe, layout.is_diffuse(slot), view);
  }
  layer.digest = hasher.Finish();
  layer.energy = MeasureEnergy(domain, grid, layer.views, layer_index, threads);
  return layer;
}

}  // namespace glint
