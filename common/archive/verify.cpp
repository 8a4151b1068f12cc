// What opening does not look at: the values of the stored lobes, and whether they fit the surface they are
// for.
#include <atomic>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>

#include "common/archive/archive.h"
#include "common/archive/format.h"
#include "common/archive/lobe_codec.h"
#include "common/base/files.h"
#include "common/base/parallel.h"

namespace glint {
namespace {

Status CheckVertices(const BakeDomain& domain) {
  for (uint32_t v = 0; v < domain.vertex_count(); ++v) {
    const auto wrong = [&](const char* what) {
      return Mismatch("vertex " + std::to_string(v) + ": " + what);
    };
    for (int c = 0; c < 3; ++c) {
      if (domain.specular[v][c] < 0 || domain.diffuse[v][c] < 0) return wrong("a reflectance is negative");
    }
  }
  return {};
}

/// The cell `row * columns + column` in words.
std::string CellName(const SliceTableView& table, uint64_t cell) {
  return "bake vertex " + std::to_string(cell / table.columns()) + ", direction " +
         std::to_string(cell % table.columns());
}

void LowerTo(uint64_t cell, std::atomic<uint64_t>* least) {
  uint64_t known = least->load();
  while (cell < known && !least->compare_exchange_weak(known, cell)) {
  }
}

/// Every stored entry decodes to a lobe within its ranges and is what the encoder writes for it; every entry
/// of the table is reached by exactly one row and column.
Status CheckEntries(const SliceTableView& table, bool direct, int threads) {
  std::atomic<uint64_t> found{0}, first_bad{~uint64_t{0}};
  ParallelFor(table.rows(), threads, 256, [&](size_t row, int) {
    uint64_t in_row = 0;
    table.Row(static_cast<uint32_t>(row)).ForEach([&](uint32_t column, const std::byte* entry) {
      ++in_row;
      const bool canonical = direct ? IsCanonicalDirect(entry, table.entry_bytes())
                                    : IsCanonicalIndirect(entry, table.entry_bytes());
      if (canonical) return;
      LowerTo(row * uint64_t{table.columns()} + column, &first_bad);
    });
    found += in_row;
  });
  if (const uint64_t bad = first_bad; bad != ~uint64_t{0}) {
    return Mismatch(CellName(table, bad) + ": a code is out of its range; bake again");
  }
  if (found != table.entries()) {
    return Mismatch(std::to_string(found) + " entries are reached, " + std::to_string(table.entries()) +
                    " stored; bake again");
  }
  return {};
}

/// Nothing is seen from behind a single-sided bake vertex.
Status CheckSides(const SliceTableView& diffuse, const BakeDomain& domain) {
  for (uint32_t v = 0; v < domain.row_count(); ++v) {
    if (!domain.Row(v).double_sided && diffuse.Find(v, 1) != nullptr) {
      return Mismatch("bake vertex " + std::to_string(v) +
                      ": single-sided, but it has a slice of its back; bake again");
    }
  }
  return {};
}

/// Slices have their lobes in order, without gaps.
Status CheckOrder(const SliceTableView& lobe, const SliceTableView& lobe_before, int threads) {
  std::atomic<uint64_t> first_bad{~uint64_t{0}};
  ParallelFor(lobe.rows(), threads, 256, [&](size_t row, int) {
    const SliceTableView::RowView before = lobe_before.Row(static_cast<uint32_t>(row));
    lobe.Row(static_cast<uint32_t>(row)).ForEach([&](uint32_t column, const std::byte*) {
      if (before.Find(column) == nullptr) LowerTo(row * uint64_t{lobe.columns()} + column, &first_bad);
    });
  });
  const uint64_t bad = first_bad;
  if (bad == ~uint64_t{0}) return {};
  return Mismatch(CellName(lobe, bad) + ": a further lobe without the one before; bake again");
}

/// What is visible of a lobe is no more than the lobe, whatever parts it is stored in; rounding aside.
Status CheckParts(const LayerViews& layer, uint32_t slot, int threads) {
  constexpr float kRounding = 1.0f / 256;  // of a lobe's part in the shortest entries, and to spare
  const float most = 1 + kRounding * static_cast<float>(layer.lobes());
  const SliceTableView& first = layer.table(0, slot);
  std::atomic<uint64_t> first_bad{~uint64_t{0}};
  ParallelFor(first.rows(), threads, 256, [&](size_t row, int) {
    const auto r = static_cast<uint32_t>(row);
    first.Row(r).ForEach([&](uint32_t column, const std::byte*) {
      float sum = 0;
      for (uint32_t lobe = 0; lobe < layer.lobes(); ++lobe) {
        const SliceTableView& table = layer.table(lobe, slot);
        const std::byte* entry = table.Find(r, column);
        if (entry == nullptr) break;
        sum += DecodeDirect(entry, table.entry_bytes()).fraction;
      }
      if (sum > most) LowerTo(row * uint64_t{first.columns()} + column, &first_bad);
    });
  });
  const uint64_t bad = first_bad;
  if (bad == ~uint64_t{0}) return {};
  return Mismatch(CellName(first, bad) + ": its visible parts are more than the whole; bake again");
}

Status CheckLayer(const LayerViews& layer, const BakeDomain& domain, bool direct, int threads) {
  for (uint32_t lobe = 0; lobe < layer.lobes(); ++lobe)
    for (uint32_t slot = 0; slot <= layer.diffuse_slot(); ++slot) {
      const SliceTableView& table = layer.table(lobe, slot);
      Status status = CheckEntries(table, direct, threads);
      if (status.ok() && lobe > 0) status = CheckOrder(table, layer.table(lobe - 1, slot), threads);
      const std::string name = slot < layer.diffuse_slot() ? "specular " + std::to_string(slot) : "diffuse";
      GLINT_RETURN_IF_ERROR(status.WithContext(name + ", lobe " + std::to_string(lobe) + " of the slices"));
    }
  for (uint32_t slot = 0; direct && slot <= layer.diffuse_slot(); ++slot)
    GLINT_RETURN_IF_ERROR(CheckParts(layer, slot, threads).WithContext("slot " + std::to_string(slot)));
  return CheckSides(layer.diffuse, domain).WithContext("diffuse");
}

/// Whether a file that cannot be opened as an archive once was one. Another version's is none of ours, unless
/// it was the version's bytes that changed.
bool WasArchive(const std::filesystem::path& path) {
  using namespace archive_format;
  const auto file = MappedFile::Open(path);
  if (!file.ok() || file->bytes().size() < kMagic.size()) return false;
  const std::byte* at = file->bytes().data();
  if (std::memcmp(at, kMagic.data(), kMagic.size()) != 0) return false;
  if (file->bytes().size() < kHeaderBytes) return true;
  uint32_t version = 0;
  uint64_t checksum = 0;
  std::memcpy(&version, at + kVersionOffset, sizeof version);
  std::memcpy(&checksum, at + kHeaderChecksumOffset, sizeof checksum);
  return version == kVersion || checksum != Checksum64({at, kHeaderChecksumOffset});
}

}  // namespace

Status VerifyArchive(const std::filesystem::path& path, int threads) {
  const Result<Archive> opened = Archive::Open(path);
  if (opened.status().kind() == ErrorKind::kBadInput && WasArchive(path))
    return Mismatch(opened.status().message());
  GLINT_RETURN_IF_ERROR(opened.status());
  const Archive& archive = *opened;
  GLINT_RETURN_IF_ERROR(CheckVertices(archive.domain()).WithContext(path.string()));
  for (size_t i = 0; i < archive.layers().size(); ++i) {
    GLINT_RETURN_IF_ERROR(CheckLayer(archive.layers()[i], archive.domain(), i == 0, threads)
                              .WithContext(path.string() + ": layer " + std::to_string(i)));
  }
  return {};
}

}  // namespace glint
