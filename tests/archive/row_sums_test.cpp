#include "common/archive/row_sums.h"

#include <gtest/gtest.h>

#include "common/base/files.h"
#include "tests/base/temp_folder.h"

namespace glint {
namespace {

/// A table of four rows with 2-byte entries, and an empty one.
class RowSumsTest : public testing::Test {
 protected:
  static std::vector<std::byte> Table(std::vector<uint16_t> columns, std::vector<uint16_t> entries) {
    SliceTableBuilder builder(4, 50, sizeof(uint16_t));
    builder.AppendRow({}, {});
    builder.AppendRow(columns, std::as_bytes(std::span(entries)));
    return builder.Finish();
  }
  static LayerViews Layer(const std::vector<std::byte>& specular, const std::vector<std::byte>& diffuse) {
    LayerViews layer;
    layer.Add(0, false, *SliceTableView::Parse(specular));
    layer.Add(0, true, *SliceTableView::Parse(diffuse));
    return layer;
  }

  const std::vector<std::byte> table_ = Table({3, 17}, {5, 6}), none_ = Table({}, {});
};

TEST_F(RowSumsTest, TellWhatARowHolds) {
  const std::vector<uint64_t> sums = RowSums(Layer(table_, none_), 4, 2);
  ASSERT_EQ(sums.size(), 4u);
  EXPECT_EQ(sums[0], sums[3]) << "empty rows";
  EXPECT_NE(sums[1], sums[0]);
  for (const auto& other : {Table({3, 17}, {5, 7}), Table({3, 18}, {5, 6}), Table({3}, {5})}) {
    EXPECT_NE(RowSum(Layer(other, none_), 1), sums[1]);
    EXPECT_EQ(RowSum(Layer(other, none_), 0), sums[0]);
  }
  EXPECT_NE(RowSum(Layer(none_, table_), 1), sums[1]);
}

TEST_F(RowSumsTest, ComeBackFromTheirFileOrAreRefused) {
  const TempFolder folder;
  const auto path = folder / "sums";
  const std::vector<uint64_t> sums = {1, 2, 3};
  ASSERT_TRUE(WriteRowSums(path, sums).ok());
  EXPECT_EQ(*ReadRowSums(path, 3), sums);
  EXPECT_EQ(ReadRowSums(path, 2).status().kind(), ErrorKind::kLimit);
  EXPECT_EQ(ReadRowSums(path, 4).status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(ReadRowSums(folder / "absent", 3).status().kind(), ErrorKind::kBadInput);
  std::vector<std::byte> bytes = *ReadFile(path, 1000);
  bytes[9] ^= std::byte{4};
  ASSERT_TRUE(PublishFile(path, bytes).ok());
  EXPECT_EQ(ReadRowSums(path, 3).status().kind(), ErrorKind::kBadInput);
}

}  // namespace
}  // namespace glint
