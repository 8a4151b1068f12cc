// Sparse tables of slices: the row displacement of laurijssen2011 section 6.2 (classic form), and the same
// without holes, where a bitmap with ranks replaces both the owner tags and the offsets (compact form; with a
// bitmap for every 64 columns: segmented form).
// Bytes: docs/archive-format.md.
#include "common/archive/slice_table.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <string>

namespace glint {
namespace {

using namespace table_internal;

constexpr uint32_t kTableMagic = 0x4C425447;  // "GTBL"
constexpr uint32_t kHeaderBytes = 64;
constexpr uint32_t kMaxColumns = 65536;
constexpr uint32_t kMaxEntryBytes = 4096;
constexpr uint64_t kMaxEntries = uint64_t{1} << kRankBits;
constexpr uint64_t kMaxSlots = uint64_t{1} << 40;

// Field offsets of the header; bytes not named are zero.
enum HeaderField : uint32_t {
  kAtMagic = 0,
  kAtForm = 4,
  kAtRows = 8,
  kAtColumns = 12,
  kAtEntryBytes = 16,
  kAtEntries = 24,
  kAtSlots = 32,
  kAtStoredRows = 40,
  kAtTotalBytes = 56,
};

/// Bitmaps of one row.
uint32_t SegmentsOf(TableForm form, uint32_t columns) {
  return form == TableForm::kSegmented ? (columns + kSegmentColumns - 1) / kSegmentColumns : 1;
}

uint64_t Align64(uint64_t n) { return (n + 63) & ~uint64_t{63}; }

template <class T>
void Store(std::byte* p, T value) {
  std::memcpy(p, &value, sizeof value);
}

bool AllZero(std::span<const std::byte> bytes) {
  return std::all_of(bytes.begin(), bytes.end(), [](std::byte b) { return b == std::byte{0}; });
}

/// Where a table's parts lie. All sums fit: rows < 2^32, segments <= 2^10, columns <= 2^16, entries < 2^37,
/// slots <= 2^40.
struct Layout {
  uint64_t row_index = kHeaderBytes, row_index_bytes = 0;
  uint64_t lines = 0, line_bytes = 0;
  uint64_t slots = 0, slot_bytes = 0;
  uint64_t total = 0;
};

Layout Place(uint64_t row_index_bytes, uint64_t line_bytes, uint64_t slot_bytes) {
  Layout layout;
  layout.row_index_bytes = row_index_bytes;
  layout.lines = Align64(layout.row_index + row_index_bytes);
  layout.line_bytes = line_bytes;
  layout.slots = Align64(layout.lines + line_bytes);
  layout.slot_bytes = slot_bytes;
  layout.total = Align64(layout.slots + slot_bytes);
  return layout;
}

/// @param rows, columns, stored_rows  of segments
Layout CompactLayout(uint64_t rows, uint64_t columns, uint64_t entry_bytes, uint64_t entries,
                     uint64_t stored_rows) {
  const uint64_t lines = (stored_rows * columns + kLineBits - 1) / kLineBits;
  return Place((rows + 63) / 64 * kRowRecordBytes, lines * kLineBytes, entries * entry_bytes);
}

Layout ClassicLayout(uint64_t rows, uint64_t entry_bytes, uint64_t slots) {
  return Place(rows * 8, 0, slots * (entry_bytes + kTagBytes));
}

Status Damaged(const char* what) {
  return BadInput(std::string("slice table: ") + what + "; the archive is damaged, bake it again");
}

/// Bytes between the parts are zero, so that no flipped bit goes unseen.
bool GapsAreZero(std::span<const std::byte> bytes, const Layout& layout) {
  const auto gap = [&](uint64_t from, uint64_t to) { return AllZero(bytes.subspan(from, to - from)); };
  return gap(layout.row_index + layout.row_index_bytes, layout.lines) &&
         gap(layout.lines + layout.line_bytes, layout.slots) &&
         gap(layout.slots + layout.slot_bytes, layout.total);
}

void StoreHeader(std::byte* out, TableForm form, uint32_t rows, uint32_t columns, uint32_t entry_bytes,
                 uint64_t entries, uint64_t slots, uint64_t stored_rows, uint64_t total) {
  Store<uint32_t>(out + kAtMagic, kTableMagic);
  Store<uint32_t>(out + kAtForm, static_cast<uint32_t>(form));
  Store(out + kAtRows, rows);
  Store(out + kAtColumns, columns);
  Store(out + kAtEntryBytes, entry_bytes);
  Store(out + kAtEntries, entries);
  Store(out + kAtSlots, slots);
  Store(out + kAtStoredRows, stored_rows);
  Store(out + kAtTotalBytes, total);
}

}  // namespace

// ---- Reading
// -------------------------------------------------------------------------------------------------------

Result<SliceTableView> SliceTableView::Parse(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeaderBytes) return Damaged("shorter than its header");
  const std::byte* head = bytes.data();
  if (Load<uint32_t>(head + kAtMagic) != kTableMagic) return Damaged("wrong magic number");
  const uint32_t form = Load<uint32_t>(head + kAtForm);
  if (form > static_cast<uint32_t>(TableForm::kSegmented)) return Damaged("unknown form");
  SliceTableView view;
  view.form_ = static_cast<TableForm>(form);
  view.rows_ = Load<uint32_t>(head + kAtRows);
  view.columns_ = Load<uint32_t>(head + kAtColumns);
  view.entry_bytes_ = Load<uint32_t>(head + kAtEntryBytes);
  view.entries_ = Load<uint64_t>(head + kAtEntries);
  view.slots_ = Load<uint64_t>(head + kAtSlots);
  view.stored_rows_ = Load<uint64_t>(head + kAtStoredRows);
  view.total_bytes_ = Load<uint64_t>(head + kAtTotalBytes);
  if (view.columns_ == 0 || view.columns_ > kMaxColumns) return Damaged("column count out of range");
  if (view.entry_bytes_ == 0 || view.entry_bytes_ > kMaxEntryBytes) return Damaged("entry size out of range");
  if (view.entries_ >= kMaxEntries || view.slots_ > kMaxSlots) return Damaged("entry count out of range");
  view.segments_ = SegmentsOf(view.form_, view.columns_);
  view.segment_columns_ = view.form_ == TableForm::kSegmented ? kSegmentColumns : view.columns_;
  if (view.stored_rows_ > uint64_t{view.rows_} * view.segments_) return Damaged("more stored rows than rows");
  if (!AllZero(bytes.subspan(20, 4)) || !AllZero(bytes.subspan(48, 8)))
    return Damaged("reserved bytes are set");
  if (view.total_bytes_ != bytes.size()) return Damaged("size does not match its header");
  GLINT_RETURN_IF_ERROR(view.form_ == TableForm::kClassic ? view.ParseClassic(bytes)
                                                          : view.ParseCompact(bytes));
  return view;
}

Status SliceTableView::ParseCompact(std::span<const std::byte> bytes) {
  const Layout layout =
      CompactLayout(uint64_t{rows_} * segments_, segment_columns_, entry_bytes_, entries_, stored_rows_);
  if (layout.total != bytes.size()) return Damaged("size does not match its counts");
  if (slots_ != entries_) return Damaged("compact form with holes");
  if (!GapsAreZero(bytes, layout)) return Damaged("padding is not zero");
  row_index_ = bytes.data() + layout.row_index;
  lines_ = bytes.data() + layout.lines;
  slots_begin_ = bytes.data() + layout.slots;
  GLINT_RETURN_IF_ERROR(CheckRanks());
  return CheckLastSegments();
}

/// A row's last segment has bits for its columns only.
Status SliceTableView::CheckLastSegments() const {
  const uint32_t spare = segments_ * segment_columns_ - columns_;
  if (spare == 0) return {};
  for (uint64_t row = 0; row < rows_; ++row) {
    const uint64_t segment = row * segments_ + segments_ - 1;
    const std::byte* record = row_index_ + (segment >> 6) * kRowRecordBytes;
    const uint64_t stored = Load<uint64_t>(record), bit = uint64_t{1} << (segment & 63);
    if ((stored & bit) == 0) continue;
    const uint64_t rank = Load<uint64_t>(record + 8) + CountPair(stored & (bit - 1), 0);
    const uint64_t end = (rank + 1) * segment_columns_;
    if (RankAt(end) != RankAt(end - spare)) return Damaged("bits beyond a row's last column");
  }
  return {};
}

Status SliceTableView::CheckRanks() const {
  uint64_t stored = 0;
  const uint64_t segments = uint64_t{rows_} * segments_;
  for (uint64_t record = 0; record < (segments + 63) / 64; ++record) {
    const std::byte* p = row_index_ + record * kRowRecordBytes;
    const uint64_t bits = Load<uint64_t>(p);
    if (Load<uint64_t>(p + 8) != stored) return Damaged("row ranks are inconsistent");
    const uint64_t rows_here = std::min<uint64_t>(64, segments - record * 64);
    if (rows_here < 64 && (bits >> rows_here) != 0) return Damaged("rows beyond the last");
    stored += CountPair(bits, 0);
  }
  if (stored != stored_rows_) return Damaged("row count is inconsistent");

  const uint64_t bit_count = stored_rows_ * segment_columns_,
                 line_count = (bit_count + kLineBits - 1) / kLineBits;
  uint64_t rank = 0;
  for (uint64_t line = 0; line < line_count; ++line) {
    const std::byte* p = lines_ + line * kLineBytes;
    uint64_t head = rank;
    uint64_t in_line = 0;
    for (uint32_t word = 0; word < kLineWords; ++word) {
      if (word == 2 || word == 4 || word == 6) head |= in_line << (kRankBits + kPairBits * (word / 2 - 1));
      const uint64_t bits = Load<uint64_t>(p + 8 + 8 * word), first = line * kLineBits + word * 64;
      const uint64_t valid = first >= bit_count ? 0 : std::min<uint64_t>(64, bit_count - first);
      if (valid < 64 && (bits >> valid) != 0) return Damaged("bits beyond the last row");
      in_line += CountPair(bits, 0);
    }
    if (Load<uint64_t>(p) != head) return Damaged("ranks are inconsistent");
    rank += in_line;
    if (rank > entries_) return Damaged("more bits than entries");
  }
  if (rank != entries_) return Damaged("entry count is inconsistent");

  uint64_t begin = 0;
  for (uint64_t row = 1; row <= stored_rows_; ++row) {
    const uint64_t end = RankAt(row * segment_columns_);
    if (end == begin) return Damaged("a stored row is empty");
    begin = end;
  }
  return {};
}

/// Entries before `bit`, which is at most the number of bits.
uint64_t SliceTableView::RankAt(uint64_t bit) const {
  if (bit == stored_rows_ * segment_columns_) return entries_;
  const uint64_t word = bit >> 6, line = word / kLineWords, in_line = word - line * kLineWords;
  const std::byte* p = lines_ + line * kLineBytes;
  uint64_t rank = Load<uint64_t>(p) & (kMaxEntries - 1);
  for (uint64_t w = 0; w < in_line; ++w) rank += CountPair(Load<uint64_t>(p + 8 + 8 * w), 0);
  return rank + CountPair(Load<uint64_t>(p + 8 + 8 * in_line) & ((uint64_t{1} << (bit & 63)) - 1), 0);
}

Status SliceTableView::ParseClassic(std::span<const std::byte> bytes) {
  const Layout layout = ClassicLayout(rows_, entry_bytes_, slots_);
  if (layout.total != bytes.size()) return Damaged("size does not match its counts");
  if (!GapsAreZero(bytes, layout)) return Damaged("padding is not zero");
  row_index_ = bytes.data() + layout.row_index;
  slots_begin_ = bytes.data() + layout.slots;
  uint64_t stored = 0;
  for (uint64_t row = 0; row < rows_; ++row) {
    const uint64_t start = Load<uint64_t>(row_index_ + row * 8);
    if (start == ~uint64_t{0}) continue;
    if (start > slots_ || slots_ - start < columns_) return Damaged("a row leaves the table");
    ++stored;
  }
  if (stored != stored_rows_) return Damaged("row count is inconsistent");
  const uint64_t slot_bytes = uint64_t{entry_bytes_} + kTagBytes;
  uint64_t entries = 0;
  for (uint64_t slot = 0; slot < slots_; ++slot) {
    const std::byte* p = slots_begin_ + slot * slot_bytes;
    const uint32_t owner = Load<uint32_t>(p);
    if (owner == kNoOwner) {
      if (!AllZero({p + kTagBytes, entry_bytes_})) return Damaged("a hole is not zero");
      continue;
    }
    if (owner >= rows_) return Damaged("an entry's owner is out of range");
    const uint64_t start = Load<uint64_t>(row_index_ + uint64_t{owner} * 8);
    if (start > slot || slot - start >= columns_) return Damaged("an entry is outside its owner");
    ++entries;
  }
  if (entries != entries_) return Damaged("entry count is inconsistent");
  return {};
}

uint64_t SliceTableView::index_bytes() const { return total_bytes_ - entries_ * entry_bytes_; }

double SliceTableView::density() const {
  const double cells = static_cast<double>(rows_) * columns_;
  return cells > 0 ? static_cast<double>(entries_) / cells : 0;
}

double SliceTableView::fill() const {
  return slots_ > 0 ? static_cast<double>(entries_) / static_cast<double>(slots_) : 1;
}

// ---- Building
// ------------------------------------------------------------------------------------------------------

namespace {

/// Fills in, behind each record's bits, how many are set before them.
void StoreRecordRanks(const Layout& layout, std::byte* table) {
  uint64_t rank = 0;
  for (uint64_t at = layout.row_index; at < layout.row_index + layout.row_index_bytes;
       at += kRowRecordBytes) {
    Store(table + at + 8, rank);
    rank += CountPair(Load<uint64_t>(table + at), 0);
  }
}

/// Fills in the heads of the rank lines.
void StoreLineRanks(const Layout& layout, std::byte* table) {
  uint64_t rank = 0;
  for (uint64_t at = layout.lines; at < layout.lines + layout.line_bytes; at += kLineBytes) {
    uint64_t head = rank, in_line = 0;
    for (uint32_t word = 0; word < kLineWords; ++word) {
      if (word == 2 || word == 4 || word == 6) head |= in_line << (kRankBits + kPairBits * (word / 2 - 1));
      in_line += CountPair(Load<uint64_t>(table + at + 8 + 8 * word), 0);
    }
    Store(table + at, head);
    rank += in_line;
  }
}

}  // namespace

SliceTableBuilder::SliceTableBuilder(uint32_t rows, uint32_t columns, uint32_t entry_bytes)
    : rows_(rows), columns_(columns), entry_bytes_(entry_bytes) {
  assert(columns >= 1 && columns <= kMaxColumns && entry_bytes >= 1 && entry_bytes <= kMaxEntryBytes);
}

void SliceTableBuilder::Reserve(size_t entries) {
  row_start_.reserve(rows_ + size_t{1});
  row_columns_.reserve(entries);
  entries_.reserve(entries * entry_bytes_);
}

void SliceTableBuilder::AppendRow(std::span<const uint16_t> columns, std::span<const std::byte> entries) {
  assert(appended_rows() < rows_);
  assert(entries.size() == columns.size() * entry_bytes_);
  assert(columns.empty() || columns.back() < columns_);
  assert(std::adjacent_find(columns.begin(), columns.end(), std::greater_equal<>()) == columns.end());
  row_columns_.insert(row_columns_.end(), columns.begin(), columns.end());
  entries_.insert(entries_.end(), entries.begin(), entries.end());
  row_start_.push_back(row_columns_.size());
}

std::vector<std::byte> SliceTableBuilder::Finish(TableForm form) const {
  return form == TableForm::kClassic ? FinishClassic() : FinishCompact(form);
}

/// Calls visit(segment, columns) for every segment that has entries, in order; columns are the row's.
template <class Visit>
void SliceTableBuilder::ForEachSegment(TableForm form, const Visit& visit) const {
  const uint64_t segments = SegmentsOf(form, columns_);
  const uint32_t width = form == TableForm::kSegmented ? kSegmentColumns : columns_;
  for (uint32_t row = 0; row < appended_rows(); ++row) {
    std::span<const uint16_t> rest = RowColumns(row);
    while (!rest.empty()) {
      const uint32_t segment = rest.front() / width;
      size_t count = 1;
      while (count < rest.size() && rest[count] / width == segment) ++count;
      visit(row * segments + segment, rest.first(count));
      rest = rest.subspan(count);
    }
  }
}

std::vector<std::byte> SliceTableBuilder::FinishCompact(TableForm form) const {
  const uint64_t entries = row_columns_.size(), segments = uint64_t{rows_} * SegmentsOf(form, columns_);
  const uint32_t width = form == TableForm::kSegmented ? kSegmentColumns : columns_;
  assert(entries < kMaxEntries);
  uint64_t stored_segments = 0;
  ForEachSegment(form, [&](uint64_t, std::span<const uint16_t>) { ++stored_segments; });
  const Layout layout = CompactLayout(segments, width, entry_bytes_, entries, stored_segments);
  std::vector<std::byte> out(layout.total);
  StoreHeader(out.data(), form, rows_, columns_, entry_bytes_, entries, entries, stored_segments,
              layout.total);

  const auto set_bit = [](std::byte* word, uint64_t bit) {
    Store(word, Load<uint64_t>(word) | (uint64_t{1} << (bit & 63)));
  };
  uint64_t stored = 0;
  ForEachSegment(form, [&](uint64_t segment, std::span<const uint16_t> columns) {
    set_bit(out.data() + layout.row_index + (segment >> 6) * kRowRecordBytes, segment);
    for (const uint16_t column : columns) {
      const uint64_t position = stored * width + column % width, word = position >> 6,
                     line = word / kLineWords;
      set_bit(out.data() + layout.lines + line * kLineBytes + 8 + 8 * (word - line * kLineWords), position);
    }
    ++stored;
  });
  StoreRecordRanks(layout, out.data());
  StoreLineRanks(layout, out.data());
  std::copy(entries_.begin(), entries_.end(), out.begin() + static_cast<ptrdiff_t>(layout.slots));
  return out;
}

namespace {

/// Finds places for rows in H: H's taken slots as bits, 64 offsets tried at once.
class FirstFit {
 public:
  explicit FirstFit(uint32_t columns) : columns_(columns), taken_(WordsFor(0), 0) {}

  /// Lowest offset within the window at which none of the row's columns is taken; takes it. Beyond what was
  /// ever taken everything fits, so that the search ends.
  uint64_t Place(std::span<const uint16_t> row) {
    // Widely spread columns first: they rule offsets out sooner than neighbours, which tend to be taken
    // together.
    order_.clear();
    constexpr size_t kStride = 16;
    for (size_t phase = 0; phase < kStride; ++phase) {
      for (size_t i = phase * 7 % kStride; i < row.size(); i += kStride) order_.push_back(row[i]);
    }
    uint64_t base = first_free_;
    if (end_ > base + kWindow) base = end_ - kWindow;
    for (;; base += 64) {
      if (WordsFor(base) > taken_.size()) taken_.resize(WordsFor(base) * 3 / 2, 0);
      uint64_t conflicts = 0;
      for (const uint16_t column : order_) {
        conflicts |= TakenFrom(base + column);
        if (conflicts == ~uint64_t{0}) break;
      }
      if (conflicts != ~uint64_t{0})
        return Take(row, base + static_cast<uint64_t>(std::countr_one(conflicts)));
    }
  }
  uint64_t end() const { return end_; }

 private:
  /// Slots back from the end that are searched: bounds the time for large tables.
  static constexpr uint64_t kWindow = uint64_t{1} << 16;

  size_t WordsFor(uint64_t base) const { return (base + 64 + columns_) / 64 + 2; }

  uint64_t TakenFrom(uint64_t slot) const {
    const uint64_t word = slot >> 6, shift = slot & 63;
    return (taken_[word] >> shift) | (taken_[word + 1] << 1 << (63 - shift));
  }

  uint64_t Take(std::span<const uint16_t> row, uint64_t offset) {
    for (const uint16_t column : row) {
      taken_[(offset + column) >> 6] |= uint64_t{1} << ((offset + column) & 63);
      end_ = std::max(end_, offset + column + 1);
    }
    while (taken_[first_free_ >> 6] == ~uint64_t{0}) first_free_ += 64;
    return offset;
  }

  uint32_t columns_;
  std::vector<uint64_t> taken_;
  std::vector<uint16_t> order_;
  uint64_t first_free_ = 0;  ///< multiple of 64; everything before is taken
  uint64_t end_ = 0;         ///< one past the last slot ever taken
};

}  // namespace

std::vector<std::byte> SliceTableBuilder::FinishClassic() const {
  std::vector<uint32_t> order;
  for (uint32_t row = 0; row < appended_rows(); ++row) {
    if (row_start_[row + 1] > row_start_[row]) order.push_back(row);
  }
  const uint64_t stored_rows = order.size();
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return RowColumns(a).size() > RowColumns(b).size(); });
  FirstFit fit(columns_);
  std::vector<uint64_t> start(rows_, ~uint64_t{0});
  uint64_t slots = 0;
  for (const uint32_t row : order) {
    start[row] = fit.Place(RowColumns(row));
    slots = std::max(slots, start[row] + columns_);
  }
  assert(slots <= kMaxSlots);

  const Layout layout = ClassicLayout(rows_, entry_bytes_, slots);
  std::vector<std::byte> out(layout.total);
  StoreHeader(out.data(), TableForm::kClassic, rows_, columns_, entry_bytes_, row_columns_.size(), slots,
              stored_rows, layout.total);
  for (uint32_t row = 0; row < rows_; ++row)
    Store(out.data() + layout.row_index + uint64_t{row} * 8, start[row]);
  const uint64_t slot_bytes = uint64_t{entry_bytes_} + kTagBytes;
  for (uint64_t slot = 0; slot < slots; ++slot)
    Store(out.data() + layout.slots + slot * slot_bytes, kNoOwner);
  for (const uint32_t row : order) {
    uint64_t entry = row_start_[row];
    for (const uint16_t column : RowColumns(row)) {
      std::byte* slot = out.data() + layout.slots + (start[row] + column) * slot_bytes;
      Store(slot, row);
      std::memcpy(slot + kTagBytes, entries_.data() + entry++ * entry_bytes_, entry_bytes_);
    }
  }
  return out;
}

}  // namespace glint
