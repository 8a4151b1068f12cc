// Payload, little-endian: u64 rays, u64 slices, u32 slots, then per slot u32 rows, u32 entries, u16
// counts[rows], u16 columns[entries], entries.
#include "common/archive/chunk.h"

#include <cstring>
#include <numeric>
#include <string>

namespace glint {
namespace {

template <class T>
void Append(const T* values, size_t count, std::vector<std::byte>* out) {
  const auto* bytes = reinterpret_cast<const std::byte*>(values);
  out->insert(out->end(), bytes, bytes + count * sizeof(T));
}

/// Bounded reads from a payload; after a failure everything reads as zero and ok() is false.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  template <class T>
  bool Read(T* values, uint64_t count) {
    if (!ok_ || count > bytes_.size() / sizeof(T)) return ok_ = false;
    if (count > 0) std::memcpy(values, bytes_.data(), count * sizeof(T));
    bytes_ = bytes_.subspan(count * sizeof(T));
    return true;
  }
  uint64_t left() const { return bytes_.size(); }

 private:
  std::span<const std::byte> bytes_;
  bool ok_ = true;
};

Status Damaged(const std::string& what) {
  return BadInput("chunk is damaged (" + what + "); it has to be computed again");
}

Status CheckRows(const BlockRows& rows, uint32_t column_begin, uint32_t column_end) {
  size_t next = 0;
  for (const uint16_t count : rows.counts) {
    for (uint16_t i = 0; i < count; ++i, ++next) {
      if (rows.columns[next] < column_begin || rows.columns[next] >= column_end)
        return Damaged("column out of range");
      if (i > 0 && rows.columns[next] <= rows.columns[next - 1]) return Damaged("columns not ascending");
    }
  }
  return {};
}

}  // namespace

std::vector<std::byte> SerializeBlock(const BlockResult& result) {
  std::vector<std::byte> out;
  Append(&result.counters.rays, 1, &out);
  Append(&result.counters.slices, 1, &out);
  const auto slots = static_cast<uint32_t>(result.slots.size());
  Append(&slots, 1, &out);
  for (const BlockRows& rows : result.slots) {
    const uint32_t sizes[2] = {static_cast<uint32_t>(rows.counts.size()),
                               static_cast<uint32_t>(rows.columns.size())};
    Append(sizes, 2, &out);
    Append(rows.counts.data(), rows.counts.size(), &out);
    Append(rows.columns.data(), rows.columns.size(), &out);
    Append(rows.entries.data(), rows.entries.size(), &out);
  }
  return out;
}

Result<BlockResult> ParseBlock(std::span<const std::byte> bytes, const GatherBlock& block,
                               const SlotLayout& layout, uint32_t entry_bytes) {
  Reader reader(bytes);
  BlockResult result;
  uint32_t stored_slots = 0;
  reader.Read(&result.counters.rays, 1);
  reader.Read(&result.counters.slices, 1);
  if (!reader.Read(&stored_slots, 1) || stored_slots != layout.count()) return Damaged("number of tables");
  for (uint32_t slot = 0; slot < layout.count(); ++slot) {
    uint32_t sizes[2] = {};
    if (!reader.Read(sizes, 2)) return Damaged("too short");
    // The view-independent table, one column a side, goes with the block that has column 0; elsewhere it has
    // no rows.
    const bool diffuse = layout.is_diffuse(slot);
    const uint32_t rows_expected = diffuse && block.first_column > 0 ? 0 : block.vertices;
    if (sizes[0] != rows_expected) return Damaged("number of rows");
    if (uint64_t{sizes[1]} * (entry_bytes + 2) > reader.left()) return Damaged("too short");
    BlockRows rows;
    rows.counts.resize(sizes[0]);
    rows.columns.resize(sizes[1]);
    rows.entries.resize(uint64_t{sizes[1]} * entry_bytes);
    if (!reader.Read(rows.counts.data(), rows.counts.size()) ||
        !reader.Read(rows.columns.data(), rows.columns.size()) ||
        !reader.Read(rows.entries.data(), rows.entries.size()))
      return Damaged("too short");
    const uint64_t total = std::accumulate(rows.counts.begin(), rows.counts.end(), uint64_t{0});
    if (total != sizes[1]) return Damaged("counts disagree");
    GLINT_RETURN_IF_ERROR(diffuse ? CheckRows(rows, 0, 2)
                                  : CheckRows(rows, block.first_column, block.first_column + block.columns));
    result.slots.push_back(std::move(rows));
  }
  if (reader.left() != 0) return Damaged("too long");
  return result;
}

}  // namespace glint
