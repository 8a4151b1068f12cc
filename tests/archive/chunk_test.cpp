#include "common/archive/chunk.h"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <string>

#include "common/base/rng.h"

namespace glint {
namespace {

constexpr uint32_t kEntryBytes = 12;
constexpr SlotLayout kLayout{2, 2};  // two lobes, then diffuse; and the same for second lobes
constexpr GatherBlock kBlock{100, 6, 0, 20};

/// Some rows with `columns` columns from `first` on, about a third of them present.
BlockRows MakeRows(uint32_t rows, uint32_t first, uint32_t columns, uint64_t seed) {
  BlockRows out;
  CounterRng rng(seed, first);
  for (uint32_t row = 0; row < rows; ++row) {
    out.BeginRow();
    for (uint32_t c = first; c < first + columns; ++c) {
      if (rng.Uniform() > 0.35f) continue;
      std::byte* entry = out.AddEntry(static_cast<uint16_t>(c), kEntryBytes);
      for (uint32_t i = 0; i < kEntryBytes; ++i) entry[i] = static_cast<std::byte>(rng.Bits() & 255);
    }
  }
  return out;
}

BlockResult MakeResult(const GatherBlock& block = kBlock) {
  BlockResult result;
  result.counters = {12345678901234ull, 77};
  for (uint32_t slot = 0; slot < kLayout.count(); ++slot)
    result.slots.push_back(!kLayout.is_diffuse(slot)
                               ? MakeRows(block.vertices, block.first_column, block.columns, slot)
                           : block.first_column == 0 ? MakeRows(block.vertices, 0, 2, 9 + slot)
                                                     : BlockRows());
  return result;
}

Result<BlockResult> Parse(const std::vector<std::byte>& bytes, const GatherBlock& block = kBlock) {
  return ParseBlock(bytes, block, kLayout, kEntryBytes);
}

void ExpectDamaged(const std::vector<std::byte>& bytes, const std::string& what) {
  const Result<BlockResult> parsed = Parse(bytes);
  ASSERT_FALSE(parsed.ok()) << what;
  EXPECT_EQ(parsed.status().kind(), ErrorKind::kBadInput) << what;
  EXPECT_NE(parsed.status().message().find("damaged"), std::string::npos) << parsed.status().message();
}

void ExpectSame(const BlockResult& a, const BlockResult& b) {
  EXPECT_EQ(a.counters.rays, b.counters.rays);
  EXPECT_EQ(a.counters.slices, b.counters.slices);
  ASSERT_EQ(a.slots.size(), b.slots.size());
  for (size_t slot = 0; slot < a.slots.size(); ++slot) {
    EXPECT_EQ(a.slots[slot].counts, b.slots[slot].counts);
    EXPECT_EQ(a.slots[slot].columns, b.slots[slot].columns);
    EXPECT_TRUE(a.slots[slot].entries == b.slots[slot].entries);
  }
}

TEST(ChunkTest, RoundTrip) {
  for (const GatherBlock& block : {kBlock, GatherBlock{0, 1, 0, 1}, GatherBlock{7, 3, 40, 2}}) {
    const BlockResult result = MakeResult(block);
    const Result<BlockResult> parsed = Parse(SerializeBlock(result), block);
    ASSERT_TRUE(parsed.ok()) << parsed.status().message();
    ExpectSame(*parsed, result);
  }
}

TEST(ChunkTest, NothingStoredRoundTrips) {
  BlockResult result;
  result.slots.resize(kLayout.count());
  for (BlockRows& rows : result.slots)
    for (uint32_t v = 0; v < kBlock.vertices; ++v) rows.BeginRow();
  const Result<BlockResult> parsed = Parse(SerializeBlock(result));
  ASSERT_TRUE(parsed.ok()) << parsed.status().message();
  ExpectSame(*parsed, result);
}

TEST(ChunkTest, TruncationAtEveryByteIsDetected) {
  const std::vector<std::byte> bytes = SerializeBlock(MakeResult());
  for (size_t size = 0; size < bytes.size(); ++size)
    ExpectDamaged({bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(size)},
                  "first " + std::to_string(size));
}

TEST(ChunkTest, MoreBytesAreDetected) {
  std::vector<std::byte> bytes = SerializeBlock(MakeResult());
  bytes.push_back(std::byte{0});
  ExpectDamaged(bytes, "one more");
}

TEST(ChunkTest, HostileCountsAreRefusedBeforeMemoryIsTaken) {
  const std::vector<std::byte> bytes = SerializeBlock(MakeResult());
  constexpr size_t kSlotCount = 16, kRowCount = 20, kEntryCount = 24;  // offsets in the payload
  for (const size_t offset : {kSlotCount, kRowCount, kEntryCount})
    for (const uint32_t value : {0u, 1u, 5u, 7u, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFEu, 0xFFFFFFFFu}) {
      std::vector<std::byte> hostile = bytes;
      std::memcpy(hostile.data() + offset, &value, sizeof value);
      ExpectDamaged(hostile, std::to_string(value) + " at " + std::to_string(offset));
    }
}

TEST(ChunkTest, RowsThatDoNotFitTheBlockAreRefused) {
  const std::pair<const char*, std::function<void(BlockResult*)>> changes[] = {
      {"count too large", [](BlockResult* r) { ++r->slots[0].counts[0]; }},
      {"counts that wrap around", [](BlockResult* r) { r->slots[0].counts[1] = 0xFFFF; }},
      {"columns not ascending",
       [](BlockResult* r) { std::swap(r->slots[1].columns[0], r->slots[1].columns[1]); }},
      {"a column twice", [](BlockResult* r) { r->slots[1].columns[1] = r->slots[1].columns[0]; }},
      {"column behind the block", [](BlockResult* r) { r->slots[0].columns.back() = 20; }},
      {"a third side", [](BlockResult* r) { r->slots[2].columns.back() = 2; }},
      {"a slot too few", [](BlockResult* r) { r->slots.pop_back(); }},
      {"a row too few", [](BlockResult* r) { r->slots[2] = MakeRows(5, 0, 2, 1); }},
      {"no rows", [](BlockResult* r) { r->slots[0] = BlockRows(); }}};
  for (const auto& [what, change] : changes) {
    BlockResult result = MakeResult();
    ASSERT_GE(result.slots[1].counts[0], 2);
    change(&result);
    ExpectDamaged(SerializeBlock(result), what);
  }
}

TEST(ChunkTest, AnotherBlocksColumnsAreRefused) {
  GatherBlock right = kBlock;
  right.first_column = 20;
  BlockResult result = MakeResult();
  result.slots.back() = BlockRows();
  EXPECT_FALSE(Parse(SerializeBlock(result), right).ok());
}

TEST(ChunkTest, AnyFlippedByteParsesToSomethingSoundOrNotAtAll) {
  const std::vector<std::byte> bytes = SerializeBlock(MakeResult());
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::vector<std::byte> flipped = bytes;
    flipped[i] ^= std::byte{0x81};
    const Result<BlockResult> parsed = Parse(flipped);
    if (!parsed.ok()) continue;
    // What parses, serialises to the bytes it came from: nothing was made up or lost.
    EXPECT_TRUE(SerializeBlock(*parsed) == flipped) << "byte " << i;
  }
}

}  // namespace
}  // namespace glint
