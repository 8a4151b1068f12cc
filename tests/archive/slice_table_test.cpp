#include "common/archive/slice_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>

#include "common/base/rng.h"

namespace glint {
namespace {

constexpr TableForm kForms[] = {TableForm::kClassic, TableForm::kCompact, TableForm::kSegmented};

/// A table as a map, to compare with.
struct Model {
  uint32_t rows, columns, entry_bytes;
  std::map<std::pair<uint32_t, uint32_t>, std::vector<std::byte>> cells;
};

std::vector<std::byte> RandomEntry(CounterRng* rng, uint32_t bytes) {
  std::vector<std::byte> entry(bytes);
  for (std::byte& b : entry) b = static_cast<std::byte>(rng->Bits() & 255);
  return entry;
}

/// Rows of random density up to `density`; about `empty` of them without entries, and the last `missing` not
/// appended.
std::pair<Model, SliceTableBuilder> RandomTable(uint64_t seed, uint32_t rows, uint32_t columns,
                                                uint32_t entry_bytes, float density, float empty,
                                                uint32_t missing = 0) {
  Model model{rows, columns, entry_bytes, {}};
  SliceTableBuilder builder(rows, columns, entry_bytes);
  for (uint32_t row = 0; row + missing < rows; ++row) {
    CounterRng rng(seed, row);
    const float row_density = rng.Uniform() < empty ? 0 : density * (0.2f + 0.8f * rng.Uniform());
    std::vector<uint16_t> taken;
    std::vector<std::byte> entries;
    for (uint32_t column = 0; column < columns; ++column) {
      if (rng.Uniform() >= row_density) continue;
      const auto entry = RandomEntry(&rng, entry_bytes);
      taken.push_back(static_cast<uint16_t>(column));
      entries.insert(entries.end(), entry.begin(), entry.end());
      model.cells[{row, column}] = entry;
    }
    builder.AppendRow(taken, entries);
  }
  return {std::move(model), std::move(builder)};
}

void ExpectEqual(const Model& model, const SliceTableView& view) {
  ASSERT_EQ(view.rows(), model.rows);
  ASSERT_EQ(view.columns(), model.columns);
  ASSERT_EQ(view.entry_bytes(), model.entry_bytes);
  ASSERT_EQ(view.entries(), model.cells.size());
  for (uint32_t row = 0; row < model.rows; ++row) {
    const auto row_view = view.Row(row);
    uint64_t in_row = 0;
    for (uint32_t column = 0; column < model.columns; ++column) {
      const std::byte* entry = view.Find(row, column);
      ASSERT_EQ(entry, row_view.Find(column));
      const auto it = model.cells.find({row, column});
      ASSERT_EQ(entry != nullptr, it != model.cells.end()) << "row " << row << " column " << column;
      if (entry == nullptr) continue;
      ++in_row;
      ASSERT_TRUE(std::equal(it->second.begin(), it->second.end(), entry))
          << "row " << row << " column " << column;
    }
    ASSERT_EQ(view.RowEmpty(row), in_row == 0);
    int64_t last = -1;
    row_view.ForEach([&](uint32_t column, const std::byte* entry) {
      EXPECT_GT(static_cast<int64_t>(column), last);
      EXPECT_EQ(entry, view.Find(row, column));
      last = column;
      --in_row;
    });
    ASSERT_EQ(in_row, 0u);
  }
}

TEST(SliceTableTest, HoldsWhatWasAppended) {
  const uint32_t columns[] = {1, 2, 63, 64, 65, 448, 642, 2562, 10242};
  for (const uint32_t c : columns) {
    const uint32_t rows = c > 1000 ? 23 : 300;
    for (const float density : {0.02f, 0.3f, 1.0f}) {
      const auto [model, builder] = RandomTable(c, rows, c, 12, density, 0.4f, 5);
      for (const TableForm form : kForms) {
        const auto bytes = builder.Finish(form);
        const auto view = SliceTableView::Parse(bytes);
        ASSERT_TRUE(view.ok()) << view.status().message();
        EXPECT_EQ(view->form(), form);
        ExpectEqual(model, *view);
      }
    }
  }
}

TEST(SliceTableTest, OtherEntrySizes) {
  for (const uint32_t entry_bytes : {1u, 3u, 8u, 12u, 24u, 100u}) {
    const auto [model, builder] = RandomTable(entry_bytes, 70, 42, entry_bytes, 0.5f, 0.2f);
    for (const TableForm form : kForms) {
      const auto bytes = builder.Finish(form);
      const auto view = SliceTableView::Parse(bytes);
      ASSERT_TRUE(view.ok()) << view.status().message();
      ExpectEqual(model, *view);
    }
  }
}

TEST(SliceTableTest, EmptyTables) {
  for (const TableForm form : kForms) {
    for (const uint32_t rows : {0u, 1u, 64u, 1000u}) {
      const auto bytes = SliceTableBuilder(rows, 642, 12).Finish(form);
      EXPECT_EQ(bytes.size() % 64, 0u);
      const auto view = SliceTableView::Parse(bytes);
      ASSERT_TRUE(view.ok()) << view.status().message();
      ExpectEqual(Model{rows, 642, 12, {}}, *view);
      EXPECT_EQ(view->density(), 0);
    }
  }
}

TEST(SliceTableTest, FullTableHasNoHoles) {
  const auto [model, builder] = RandomTable(3, 100, 642, 12, 100.0f, 0);
  for (const TableForm form : kForms) {
    const auto bytes = builder.Finish(form);
    const auto view = SliceTableView::Parse(bytes);
    ASSERT_TRUE(view.ok());
    EXPECT_EQ(view->density(), 1);
    EXPECT_EQ(view->fill(), 1);
  }
}

TEST(SliceTableTest, SameInputSameBytes) {
  for (const TableForm form : kForms) {
    EXPECT_EQ(RandomTable(9, 200, 642, 12, 0.3f, 0.3f).second.Finish(form),
              RandomTable(9, 200, 642, 12, 0.3f, 0.3f).second.Finish(form));
  }
}

TEST(SliceTableTest, CompactIndexIsSmall) {
  // 12 %, the sparsest of the real patterns, and no row empty: the worst case.
  SliceTableBuilder builder(2000, 642, 12);
  for (uint32_t row = 0; row < 2000; ++row) {
    std::vector<uint16_t> taken(77);
    std::iota(taken.begin(), taken.end(), static_cast<uint16_t>(row % 500));
    builder.AppendRow(taken, std::vector<std::byte>(taken.size() * 12));
  }
  const auto bytes = builder.Finish(TableForm::kCompact);
  const auto view = SliceTableView::Parse(bytes);
  ASSERT_TRUE(view.ok());
  EXPECT_LT(static_cast<double>(view->index_bytes()) / static_cast<double>(view->entries()), 1.25);
}

TEST(SliceTableTest, EmptyRowsCostAQuarterByte) {
  SliceTableBuilder builder(64000, 642, 12);
  const auto bytes = builder.Finish(TableForm::kCompact);
  EXPECT_LE(bytes.size(), 64000u / 4 + 128);
}

TEST(SliceTableTest, EveryTruncationIsRefused) {
  const auto [model, builder] = RandomTable(4, 20, 42, 12, 0.4f, 0.3f);
  for (const TableForm form : kForms) {
    const auto bytes = builder.Finish(form);
    for (size_t n = 0; n < bytes.size(); ++n) {
      EXPECT_FALSE(SliceTableView::Parse(std::span(bytes).first(n)).ok()) << n;
    }
    auto longer = bytes;
    longer.resize(bytes.size() + 64);
    EXPECT_FALSE(SliceTableView::Parse(longer).ok());
  }
}

/// Whatever Parse accepts must stay within the bytes; run under AddressSanitizer the heap block's ends are
/// the check, and the explicit bounds are one without it.
TEST(SliceTableTest, HostileBytesAreRefusedOrHarmless) {
  const auto [model, builder] = RandomTable(5, 70, 42, 12, 0.4f, 0.3f);
  for (const TableForm form : kForms) {
    const auto good = builder.Finish(form);
    int refused = 0, accepted = 0;
    for (size_t bit = 0; bit < good.size() * 8; bit += 5) {
      auto bad = good;
      bad[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
      const auto view = SliceTableView::Parse(bad);
      if (!view.ok()) {
        EXPECT_EQ(view.status().kind(), ErrorKind::kBadInput);
        ++refused;
        continue;
      }
      ++accepted;
      for (uint32_t row = 0; row < view->rows(); ++row) {
        for (uint32_t column = 0; column < view->columns(); ++column) {
          const std::byte* entry = view->Find(row, column);
          if (entry == nullptr) continue;
          ASSERT_GE(entry, bad.data() + 64);
          ASSERT_LE(entry + view->entry_bytes(), bad.data() + bad.size());
        }
      }
    }
    EXPECT_GT(refused, 100);
    EXPECT_GT(accepted, 100);  // flips inside entries: the archive's checksums see those
  }
}

TEST(SliceTableTest, HugeCountsAreRefused) {
  auto bytes = SliceTableBuilder(3, 642, 12).Finish(TableForm::kCompact);
  for (const TableForm form : kForms) {
    for (const size_t field : {8u, 12u, 16u, 24u, 32u, 40u, 56u}) {
      for (const uint64_t value :
           {uint64_t{0x7FFFFFFF}, uint64_t{0xFFFFFFFF}, ~uint64_t{0}, uint64_t{1} << 63}) {
        auto bad = bytes;
        bad[4] = static_cast<std::byte>(form);
        std::copy_n(reinterpret_cast<const std::byte*>(&value), field >= 24 ? 8 : 4, bad.begin() + field);
        EXPECT_FALSE(SliceTableView::Parse(bad).ok());
      }
    }
  }
}

}  // namespace
}  // namespace glint
