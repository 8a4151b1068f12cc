// Archives from strangers: opening, and every look-up in what opens. The first byte chooses: the input as it
// is; with its checksums made right, so that what stands behind them is reached; or a table alone.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/lobe_codec.h"
#include "common/archive/slice_table.h"
#include "tests/archive/archive_fixture.h"

namespace {

using glint::SliceTableView;

void Check(bool holds) {
  if (!holds) std::abort();
}

/// Looks at every cell of the first rows; counts can be claimed only as far as bytes back them, but empty
/// rows are cheap to claim.
void LookUpEverything(const SliceTableView& table, bool direct) {
  constexpr uint32_t kRows = 256;
  for (uint32_t row = 0; row < table.rows(); row += 1 + table.rows() / kRows) {
    bool any = false;
    table.Row(row).ForEach([&](uint32_t column, const std::byte* entry) {
      any = true;
      Check(entry == table.Find(row, column));
      volatile std::byte last = entry[table.entry_bytes() - 1];
      (void)last;
      const auto& sizes = glint::kEntryBytes;
      if (std::find(sizes.begin(), sizes.end(), table.entry_bytes()) == sizes.end()) return;
      if (direct) {
        const glint::DirectLobe lobe = glint::DecodeDirect(entry, table.entry_bytes());
        Check(lobe.fraction >= 0 && lobe.fraction <= 1 && lobe.kappa_ratio > 0);
      } else {
        const glint::IndirectLobe lobe = glint::DecodeIndirect(entry, table.entry_bytes());
        Check(lobe.kappa >= 0 && lobe.kappa <= glint::kMaxKappa && lobe.alpha.x >= 0 &&
              lobe.alpha.x <= 65504);
      }
    });
    Check(table.form() == glint::TableForm::kClassic || any != table.RowEmpty(row));
  }
}

void OpenArchive(std::span<const std::byte> bytes) {
  const auto archive = glint::Archive::FromMemory(bytes, "fuzz");
  if (!archive.ok()) {
    Check(!archive.status().message().empty());
    return;
  }
  const glint::BakeDomain& domain = archive->domain();
  for (const auto& triangle : domain.triangles) {
    for (const uint32_t vertex : triangle) Check(vertex < domain.vertex_count());
  }
  for (const uint16_t shape : domain.shape) Check(shape < domain.shapes.size());
  for (size_t i = 0; i < archive->layers().size(); ++i) {
    const glint::LayerViews& layer = archive->layers()[i];
    for (uint32_t lobe = 0; lobe < layer.lobes(); ++lobe)
      for (uint32_t slot = 0; slot <= layer.diffuse_slot(); ++slot)
        LookUpEverything(layer.table(lobe, slot), i == 0);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const auto* begin = reinterpret_cast<const std::byte*>(data);
  std::vector<std::byte> bytes(begin + 1,
                               begin + size);  // its own block, so that reading past its end is seen
  switch (data[0] % 3) {
    case 0:
      OpenArchive(bytes);
      break;
    case 1:
      glint::archive_fixture::Reseal(bytes);
      OpenArchive(bytes);
      break;
    default:
      if (const auto table = SliceTableView::Parse(bytes); table.ok()) LookUpEverything(*table, true);
  }
  return 0;
}
