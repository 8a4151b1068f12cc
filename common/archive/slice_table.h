#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/base/status.h"

namespace glint {

/// How a sparse table is stored (laurijssen2011 section 6.2, and docs/archive-format.md):
///   kClassic  A[i][j] = H[O[i] + j] with an owner tag beside each H entry; rows placed by bitset first fit
///   kCompact  A[i][j] = H[O[i] + rank_i(j)]: a bitmap per row is owner test and free-slice mask; no holes in H
enum class TableForm : uint8_t { kClassic = 0, kCompact = 1 };

/// Read-only random access to a table's serialised bytes. Cheap to copy; does not own the bytes.
class SliceTableView {
 public:
  SliceTableView() = default;
  /// Checks every size and invariant that Find relies on (kBadInput otherwise), so that Find needs no checks.
  static Result<SliceTableView> Parse(std::span<const std::byte> bytes);

  /// Entry of (row, column), entry_bytes() long, or nullptr when absent. row < rows(), column < columns().
  const std::byte* Find(uint32_t row, uint32_t column) const;
  bool RowEmpty(uint32_t row) const;

  TableForm form() const;
  uint32_t rows() const;
  uint32_t columns() const;
  uint32_t entry_bytes() const;
  uint64_t entries() const;       ///< stored
  uint64_t index_bytes() const;   ///< everything but the entries themselves (holes of the classic form count)
  double density() const;         ///< entries / (rows * columns)
  double fill() const;            ///< entries / slots of H

 private:
  // (members to be chosen; keep Find inline and branch-light)
};

/// Gathers a table row by row and serialises it.
class SliceTableBuilder {
 public:
  SliceTableBuilder(uint32_t rows, uint32_t columns, uint32_t entry_bytes);
  /// Appends the next row (rows come in order; rows not appended at the end are empty). `columns` ascending and unique;
  /// `entries` has columns.size() * entry_bytes bytes.
  void AppendRow(std::span<const uint16_t> columns, std::span<const std::byte> entries);
  /// Serialised table, 64-byte aligned sections inside, deterministic.
  std::vector<std::byte> Finish(TableForm form) const;

 private:
  uint32_t rows_, columns_, entry_bytes_;
};

}  // namespace glint
