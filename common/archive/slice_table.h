#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "common/base/status.h"

namespace glint {

/// How a sparse table is stored (laurijssen2011 section 6.2, and docs/archive-format.md):
///   kClassic  A[i][j] = H[O[i] + j] with an owner tag beside each H entry; rows placed by bitset first fit
///   kCompact  A[i][j] = H[O[i] + rank_i(j)]: a bitmap per row is owner test and free-slice mask; no holes in
///   H.
///             The bitmaps of the rows that are not empty follow one another, and a rank directory shares
///             their cache lines, so that O[i] + rank_i(j) is one rank over all of them and O is not stored.
///   kSegmented  kCompact with every 64 columns of a row as a row of its own: what a row has nothing of costs
///             two bits in place of 64. For rows whose entries lie together, with wide gaps between.
enum class TableForm : uint8_t { kClassic = 0, kCompact = 1, kSegmented = 2 };

/// The form that the bake writes: its index is some 30 times smaller, it is built 8 times faster, and H has
/// no holes; a present entry that no cache holds costs one line more (docs/archive-format.md has the
/// figures).
inline constexpr TableForm kDefaultTableForm = TableForm::kCompact;

static_assert(std::endian::native == std::endian::little, "tables are used in place and are little-endian");

namespace table_internal {

inline constexpr uint32_t kLineBytes = 64;  ///< one rank line: a head word and kLineWords words of bitmap
inline constexpr uint32_t kLineWords = 7;
inline constexpr uint32_t kLineBits = 64 * kLineWords;
inline constexpr uint32_t kRankBits = 37;  ///< of the head: entries before the line
inline constexpr uint32_t kPairBits = 9;   ///< of the head, three times: entries before words 2, 4 and 6
inline constexpr uint32_t kRowRecordBytes = 16;  ///< 64 rows: their not-empty bits, and such rows before them
inline constexpr uint32_t kSegmentColumns = 64;  ///< of the segmented form
inline constexpr uint32_t kTagBytes = 4;
inline constexpr uint32_t kNoOwner = 0xFFFFFFFFu;

template <class T>
inline T Load(const std::byte* p) {
  T value;
  std::memcpy(&value, p, sizeof value);
  return value;
}

/// Set bits of a and b together. Bit arithmetic, because the baseline instruction set has no popcount, and
/// the library call that stands in for it cannot be inlined.
inline uint64_t CountPair(uint64_t a, uint64_t b) {
  constexpr uint64_t k5 = 0x5555555555555555u, k3 = 0x3333333333333333u, kF = 0x0F0F0F0F0F0F0F0Fu;
  a -= (a >> 1) & k5;
  b -= (b >> 1) & k5;
  const uint64_t nibbles = (a & k3) + ((a >> 2) & k3) + (b & k3) + ((b >> 2) & k3);
  return (((nibbles & kF) + ((nibbles >> 4) & kF)) * 0x0101010101010101u) >> 56;
}

}  // namespace table_internal

/// Read-only random access to a table's serialised bytes. Cheap to copy; does not own the bytes.
class SliceTableView {
 public:
  class RowView;

  SliceTableView() = default;
  /// Checks every size and invariant that Find relies on (kBadInput otherwise), so that Find needs no checks.
  static Result<SliceTableView> Parse(std::span<const std::byte> bytes);

  /// Entry of (row, column), entry_bytes() long, or nullptr when absent. row < rows(), column < columns().
  const std::byte* Find(uint32_t row, uint32_t column) const;
  /// Several look-ups in one row share its part of the work. row < rows().
  RowView Row(uint32_t row) const;
  bool RowEmpty(uint32_t row) const;

  TableForm form() const { return form_; }
  uint32_t rows() const { return rows_; }
  uint32_t columns() const { return columns_; }
  uint32_t entry_bytes() const { return entry_bytes_; }
  uint64_t entries() const { return entries_; }  ///< stored
  uint64_t index_bytes() const;                  ///< everything but the entries themselves (holes count)
  double density() const;                        ///< entries / (rows * columns)
  double fill() const;                           ///< entries / slots of H

 private:
  friend class RowView;
  Status ParseCompact(std::span<const std::byte> bytes);
  Status ParseClassic(std::span<const std::byte> bytes);
  Status CheckRanks() const;
  Status CheckLastSegments() const;
  uint64_t RankAt(uint64_t bit) const;

  TableForm form_ = TableForm::kCompact;
  uint32_t rows_ = 0, columns_ = 0, entry_bytes_ = 0;
  /// A row's segments, each with a bitmap of its own; compact: the whole row is one.
  uint32_t segments_ = 1, segment_columns_ = 0;
  uint64_t entries_ = 0, slots_ = 0, stored_rows_ = 0, total_bytes_ = 0;
  const std::byte* row_index_ = nullptr;    ///< compact: records of segments; classic: u64 O[i]
  const std::byte* lines_ = nullptr;        ///< compact: rank lines
  const std::byte* slots_begin_ = nullptr;  ///< H
};

/// One row of a table; valid while the table's bytes are.
class SliceTableView::RowView {
 public:
  bool empty() const { return empty_; }  ///< no entry is stored
  /// Entry of `column` < columns(), or nullptr when absent.
  const std::byte* Find(uint32_t column) const;
  /// Calls visit(column, entry) for every stored entry, columns ascending.
  template <class Visit>
  void ForEach(const Visit& visit) const;

 private:
  friend class SliceTableView;
  const std::byte* FindBit(uint64_t position) const;
  const std::byte* FindSegmented(uint32_t column) const;
  const std::byte* FindClassic(uint32_t column) const;
  bool AnySegment(uint32_t count) const;
  bool SegmentEmpty(uint32_t segment) const;

  const std::byte* lines_ = nullptr;    ///< null: classic
  const std::byte* records_ = nullptr;  ///< segmented: of segments
  const std::byte* slots_ = nullptr;
  uint64_t start_ = 0;  ///< compact: bit of column 0; segmented: first segment; classic: O[i]
  uint32_t entry_bytes_ = 0, columns_ = 0, row_ = 0;
  bool empty_ = true;
};

/// Gathers a table row by row and serialises it.
class SliceTableBuilder {
 public:
  /// columns in [1, 65536], entry_bytes in [1, 4096].
  SliceTableBuilder(uint32_t rows, uint32_t columns, uint32_t entry_bytes);
  /// Makes room for this many entries of all rows together.
  void Reserve(size_t entries);
  /// Appends the next row (rows come in order; rows not appended at the end are empty). `columns` ascending
  /// and unique; `entries` has columns.size() * entry_bytes bytes.
  void AppendRow(std::span<const uint16_t> columns, std::span<const std::byte> entries);
  /// Serialised table, 64-byte aligned sections inside, deterministic. Fewer than 2^37 entries.
  std::vector<std::byte> Finish(TableForm form = kDefaultTableForm) const;

 private:
  template <class Visit>
  void ForEachSegment(TableForm form, const Visit& visit) const;
  std::vector<std::byte> FinishCompact(TableForm form) const;
  std::vector<std::byte> FinishClassic() const;
  std::span<const uint16_t> RowColumns(uint32_t row) const {
    return {row_columns_.data() + row_start_[row], row_columns_.data() + row_start_[row + 1]};
  }
  uint32_t appended_rows() const { return static_cast<uint32_t>(row_start_.size() - 1); }

  uint32_t rows_, columns_, entry_bytes_;
  std::vector<uint64_t> row_start_{0};  ///< first entry of each appended row, then the number of entries
  std::vector<uint16_t> row_columns_;
  std::vector<std::byte> entries_;
};

// Look-ups, inline: the renderer makes dozens for each pixel.

inline SliceTableView::RowView SliceTableView::Row(uint32_t row) const {
  using namespace table_internal;
  RowView view;
  view.slots_ = slots_begin_;
  view.entry_bytes_ = entry_bytes_;
  view.columns_ = columns_;
  view.row_ = row;
  if (form_ == TableForm::kCompact) [[likely]] {
    const std::byte* record = row_index_ + uint64_t{row >> 6} * kRowRecordBytes;
    const uint64_t stored = Load<uint64_t>(record), bit = uint64_t{1} << (row & 63);
    view.lines_ = lines_;
    view.empty_ = (stored & bit) == 0;
    view.start_ = (Load<uint64_t>(record + 8) + CountPair(stored & (bit - 1), 0)) * columns_;
  } else if (form_ == TableForm::kSegmented) {
    view.lines_ = lines_;
    view.records_ = row_index_;
    view.start_ = uint64_t{row} * segments_;
    view.empty_ = !view.AnySegment(segments_);
  } else {
    view.start_ = Load<uint64_t>(row_index_ + uint64_t{row} * 8);
    view.empty_ = view.start_ == ~uint64_t{0};
  }
  return view;
}

/// Whether any of the row's `count` segments has an entry.
inline bool SliceTableView::RowView::AnySegment(uint32_t count) const {
  using namespace table_internal;
  for (uint64_t segment = start_, end = start_ + count; segment < end;) {
    const uint64_t shift = segment & 63, here = std::min<uint64_t>(64 - shift, end - segment);
    const uint64_t stored = Load<uint64_t>(records_ + (segment >> 6) * kRowRecordBytes) >> shift;
    if (here < 64 ? (stored & ((uint64_t{1} << here) - 1)) != 0 : stored != 0) return true;
    segment += here;
  }
  return false;
}

inline bool SliceTableView::RowView::SegmentEmpty(uint32_t segment) const {
  const uint64_t at = start_ + segment;
  const auto stored = table_internal::Load<uint64_t>(records_ + (at >> 6) * table_internal::kRowRecordBytes);
  return (stored >> (at & 63) & 1) == 0;
}

inline const std::byte* SliceTableView::RowView::FindSegmented(uint32_t column) const {
  using namespace table_internal;
  const uint64_t segment = start_ + column / kSegmentColumns;
  const std::byte* record = records_ + (segment >> 6) * kRowRecordBytes;
  const uint64_t stored = Load<uint64_t>(record), bit = uint64_t{1} << (segment & 63);
  if ((stored & bit) == 0) return nullptr;
  const uint64_t rank = Load<uint64_t>(record + 8) + CountPair(stored & (bit - 1), 0);
  return FindBit(rank * kSegmentColumns + column % kSegmentColumns);
}

inline const std::byte* SliceTableView::RowView::FindBit(uint64_t position) const {
  using namespace table_internal;
  const uint64_t word = position >> 6;
  const uint64_t line_index = word / kLineWords, in_line = word - line_index * kLineWords;
  const std::byte* line = lines_ + line_index * kLineBytes;
  const uint64_t bits = Load<uint64_t>(line + 8 + 8 * in_line), bit = uint64_t{1} << (position & 63);
  if ((bits & bit) == 0) return nullptr;
  const uint64_t head = Load<uint64_t>(line);
  const uint64_t before_line = head & ((uint64_t{1} << kRankBits) - 1);
  const uint64_t before_pair =
      (((head >> kRankBits) << kPairBits) >> (kPairBits * (in_line >> 1))) & ((1u << kPairBits) - 1);
  const uint64_t first_of_pair =
      Load<uint64_t>(line + 8 + 8 * (in_line & ~uint64_t{1})) & (0 - (in_line & 1));
  const uint64_t rank = before_line + before_pair + CountPair(first_of_pair, bits & (bit - 1));
  return slots_ + rank * entry_bytes_;
}

inline const std::byte* SliceTableView::RowView::FindClassic(uint32_t column) const {
  using namespace table_internal;
  const std::byte* slot = slots_ + (start_ + column) * (uint64_t{entry_bytes_} + kTagBytes);
  return Load<uint32_t>(slot) == row_ ? slot + kTagBytes : nullptr;
}

inline const std::byte* SliceTableView::RowView::Find(uint32_t column) const {
  if (empty_) return nullptr;
  if (records_) return FindSegmented(column);
  return lines_ ? FindBit(start_ + column) : FindClassic(column);
}

template <class Visit>
void SliceTableView::RowView::ForEach(const Visit& visit) const {
  if (empty_) return;
  const uint32_t step = records_ ? table_internal::kSegmentColumns : columns_;
  for (uint32_t first = 0; first < columns_; first += step) {
    if (records_ && SegmentEmpty(first / step)) continue;
    for (uint32_t column = first; column < std::min(first + step, columns_); ++column)
      if (const std::byte* entry = Find(column)) visit(column, entry);
  }
}

inline const std::byte* SliceTableView::Find(uint32_t row, uint32_t column) const {
  return Row(row).Find(column);
}

inline bool SliceTableView::RowEmpty(uint32_t row) const { return Row(row).empty(); }

}  // namespace glint
