#include "coordinator/layer.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <numeric>
#include <string>
#include <utility>

#include "common/archive/lobe_codec.h"
#include "common/base/frame.h"
#include "common/base/parallel.h"

namespace glint {
namespace {

Result<BlockResult> ReadChunk(ChunkStore& store, const TaskSpec& task, uint32_t slots, uint32_t entry_bytes) {
  const std::optional<Digest> digest = store.FindResult(task.key);
  if (!digest)
    return Mismatch("the result of task " + task.key.Hex() + " has vanished from " + store.root().string());
  auto parse = [&]() -> Result<BlockResult> {
    GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> payload, store.Get(*digest));
    return ParseBlock(payload, task.block, slots, entry_bytes);
  };
  Result<BlockResult> block = parse();
  if (block.ok() || block.status().kind() == ErrorKind::kIo) return block;
  GLINT_RETURN_IF_ERROR(store.Discard(task.key, *digest));
  return Mismatch(block.status().message());
}

/// Appends one vertex's rows of all its direction blocks as one row.
class RowJoiner {
 public:
  void Add(const BlockRows& rows, size_t row, size_t first_entry, uint32_t entry_bytes) {
    const size_t count = rows.counts[row];
    columns_.insert(columns_.end(), rows.columns.begin() + first_entry,
                    rows.columns.begin() + first_entry + count);
    entries_.insert(entries_.end(), rows.entries.begin() + first_entry * entry_bytes,
                    rows.entries.begin() + (first_entry + count) * entry_bytes);
  }
  void Flush(SliceTableBuilder* builder) {
    builder->AppendRow(columns_, entries_);
    columns_.clear();
    entries_.clear();
  }

 private:
  std::vector<uint16_t> columns_;
  std::vector<std::byte> entries_;
};

/// The direction blocks of one block of vertices: rows side by side.
void AppendBlocks(const std::vector<BlockResult>& blocks, uint32_t slot, uint32_t vertices,
                  uint32_t entry_bytes, SliceTableBuilder* builder) {
  RowJoiner joiner;
  std::vector<size_t> next(blocks.size(), 0);
  for (uint32_t row = 0; row < vertices; ++row) {
    for (size_t b = 0; b < blocks.size(); ++b) {
      const BlockRows& rows = blocks[b].slots[slot];
      if (rows.counts.empty()) continue;
      joiner.Add(rows, row, next[b], entry_bytes);
      next[b] += rows.counts[row];
    }
    joiner.Flush(builder);
  }
}

/// Light of one vertex's slices under a uniform environment, summed over directions, lobes and sides.
struct VertexEnergy {
  double layer = 0, unoccluded = 0;
};

/// @param layer_index  0: a missing entry is the whole BRDF; else nothing
VertexEnergy MeasureVertex(const BakeDomain& domain, const DirectionGrid& grid, const LayerViews& views,
                           int layer_index, uint32_t v) {
  VertexEnergy energy;
  const BakeVertex vertex = domain.Row(v);
  const BrdfShape& shape = domain.shapes[vertex.shape];
  const Brdf brdf{shape.model, shape.shape, vertex.specular, vertex.diffuse};
  auto add = [&](const SliceTableView& table, uint32_t column, double weight) {
    const std::byte* entry = table.Find(v, column);
    energy.unoccluded += weight;
    if (layer_index == 0) {
      energy.layer += weight * (entry ? DecodeDirect(entry).fraction : 1);
    } else if (entry) {
      energy.layer += weight * Luminance(DecodeIndirect(entry).alpha);
    }
  };
  for (uint32_t column = 0; column < grid.size(); ++column) {
    const float cosine = glm::dot(vertex.normal, grid.direction(column));
    if (cosine <= 0 && !vertex.double_sided) continue;
    const BrdfSlice slice = LookupSlice(shape, std::abs(cosine));
    for (int k = 0; k < slice.lobes; ++k)
      add(views.specular[k], column, Luminance(slice.lobe[k].Weight(vertex.specular)));
    const float diffuse = Luminance(DiffuseAlbedo(brdf, std::abs(cosine)));
    if (diffuse > 0) add(views.diffuse, cosine > 0 ? 0 : 1, diffuse);
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
                         const DirectionGrid& grid, TableForm form, int threads) {
  const auto slots = static_cast<uint32_t>(domain.max_lobes()) + 1;
  const int layer_index = tasks.front().layer;
  const uint32_t entry_bytes = layer_index == 0 ? kDirectEntryBytes : kIndirectEntryBytes;
  std::vector<SliceTableBuilder> builders;
  for (uint32_t slot = 0; slot < slots; ++slot)
    builders.emplace_back(domain.row_count(), slot + 1 < slots ? grid.size() : 2, entry_bytes);

  Layer layer;
  Status damage;
  for (size_t first = 0; first < tasks.size();) {
    std::vector<BlockResult> blocks;
    const GatherBlock& rows = tasks[first].block;
    for (; first < tasks.size() && tasks[first].block.first_vertex == rows.first_vertex; ++first) {
      Result<BlockResult> block = ReadChunk(store, tasks[first], slots, entry_bytes);
      if (block.ok()) {
        layer.counters += block->counters;
        blocks.push_back(std::move(block).value());
      } else if (block.status().kind() == ErrorKind::kMismatch) {
        damage = block.status();  // and look on: one more run then mends all of them
      } else {
        return block.status();
      }
    }
    if (!damage.ok()) continue;
    for (uint32_t slot = 0; slot < slots; ++slot)
      AppendBlocks(blocks, slot, rows.vertices, entry_bytes, &builders[slot]);
  }
  GLINT_RETURN_IF_ERROR(damage);

  layer.slots.resize(slots);
  ParallelFor(slots, threads, 1, [&](size_t slot, int) { layer.slots[slot] = builders[slot].Finish(form); });
  Hasher hasher;
  for (uint32_t slot = 0; slot < slots; ++slot) {
    GLINT_ASSIGN_OR_RETURN(SliceTableView view, SliceTableView::Parse(layer.slots[slot]));
    layer.stored += view.entries();
    HashRows(view, &hasher);
    if (slot + 1 < slots) {
      layer.views.specular.push_back(view);
    } else {
      layer.views.diffuse = view;
    }
  }
  layer.digest = hasher.Finish();
  layer.energy = MeasureEnergy(domain, grid, layer.views, layer_index, threads);
  return layer;
}

}  // namespace glint
