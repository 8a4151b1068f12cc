#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/archive/archive.h"
#include "common/base/status.h"

namespace glint {

// Checksums of a layer row by row, beside an archive whose tables are too large to be read as a whole: who
// needs a few rows reads those, and knows that they are sound (Archive::Checks::kAllButTables).

/// XXH3 of all that the layer stores of a row: columns and entries of all tables in turn. row < rows of the
/// tables.
uint64_t RowSum(const LayerViews& layer, uint32_t row);
/// Of all rows.
std::vector<uint64_t> RowSums(const LayerViews& layer, uint32_t rows, int threads);

/// Published atomically, with a checksum over all. kIo.
Status WriteRowSums(const std::filesystem::path& path, const std::vector<uint64_t>& sums);
/// kBadInput, kLimit, naming the file: it is missing, damaged, or not of so many rows.
Result<std::vector<uint64_t>> ReadRowSums(const std::filesystem::path& path, uint32_t rows);

}  // namespace glint
