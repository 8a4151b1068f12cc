#include "common/archive/row_sums.h"

#include <cstddef>
#include <cstring>
#include <span>
#include <string>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/base/parallel.h"

namespace glint {
namespace {

constexpr const char* kRemedy = "remove it and resume the bake";

void Append(const void* bytes, size_t size, std::vector<std::byte>* out) {
  const auto* begin = static_cast<const std::byte*>(bytes);
  out->insert(out->end(), begin, begin + size);
}

}  // namespace

uint64_t RowSum(const LayerViews& layer, uint32_t row) {
  thread_local std::vector<std::byte> stored;
  stored.clear();
  for (uint32_t lobe = 0; lobe < layer.lobes(); ++lobe) {
    for (uint32_t slot = 0; slot <= layer.diffuse_slot(); ++slot) {
      const SliceTableView& table = layer.table(lobe, slot);
      uint32_t entries = 0;
      table.Row(row).ForEach([&](uint32_t column, const std::byte* entry) {
        Append(&column, sizeof column, &stored);
        Append(entry, table.entry_bytes(), &stored);
        ++entries;
      });
      Append(&entries, sizeof entries, &stored);
    }
  }
  return Checksum64(stored);
}

std::vector<uint64_t> RowSums(const LayerViews& layer, uint32_t rows, int threads) {
  constexpr size_t kGrain = 256;
  std::vector<uint64_t> sums(rows);
  ParallelFor(rows, threads, kGrain,
              [&](size_t row, int) { sums[row] = RowSum(layer, static_cast<uint32_t>(row)); });
  return sums;
}

Status WriteRowSums(const std::filesystem::path& path, const std::vector<uint64_t>& sums) {
  std::vector<uint64_t> words = sums;
  words.push_back(Checksum64(std::as_bytes(std::span(sums))));
  return PublishFile(path, std::as_bytes(std::span(words)));
}

Result<std::vector<uint64_t>> ReadRowSums(const std::filesystem::path& path, uint32_t rows) {
  const uint64_t size = (uint64_t{rows} + 1) * sizeof(uint64_t);
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, size));
  if (bytes.size() != size)
    return BadInput(path.string() + ": not the checksums of " + std::to_string(rows) + " rows; " + kRemedy);
  std::vector<uint64_t> words(rows + size_t{1});
  std::memcpy(words.data(), bytes.data(), bytes.size());
  const uint64_t sum = words.back();
  words.pop_back();
  if (sum != Checksum64(std::as_bytes(std::span(words))))
    return BadInput(path.string() + ": damaged; " + kRemedy);
  return words;
}

}  // namespace glint
