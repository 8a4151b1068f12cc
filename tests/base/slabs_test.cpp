#include "common/base/slabs.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <thread>
#include <vector>

namespace glint {
namespace {

/// Arrays of all sizes up to several slabs', each filled with a byte of its own.
struct Filled {
  std::byte* begin;
  size_t bytes;
  std::byte value;
  bool holds() const {
    for (size_t i = 0; i < bytes; ++i)
      if (begin[i] != value) return false;
    return true;
  }
};

std::vector<Filled> Fill(Slabs* slabs, unsigned first_value) {
  std::vector<Filled> all;
  unsigned value = first_value;
  for (size_t bytes = 1; bytes < (size_t{3} << 20); bytes += bytes / 3 + 7) {
    Filled filled{slabs->Allocate(bytes), bytes, static_cast<std::byte>(value++ % 251)};
    std::memset(filled.begin, static_cast<int>(filled.value), bytes);
    all.push_back(filled);
  }
  return all;
}

TEST(SlabsTest, ArraysAreAlignedAndApart) {
  Slabs slabs;
  const std::vector<Filled> all = Fill(&slabs, 1);
  for (const Filled& filled : all) {
    EXPECT_EQ(reinterpret_cast<uintptr_t>(filled.begin) % 16, 0u);
    EXPECT_TRUE(filled.holds()) << filled.bytes;
  }
}

TEST(SlabsTest, ThreadsGetArraysOfTheirOwn) {
  Slabs slabs;
  std::vector<Filled> all[3];
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 3; ++t) threads.emplace_back([&, t] { all[t] = Fill(&slabs, 70 * t); });
  for (std::thread& thread : threads) thread.join();
  for (const auto& some : all)
    for (const Filled& filled : some) EXPECT_TRUE(filled.holds()) << filled.bytes;
}

TEST(SlabsTest, AnArrayOfNothingIsSomewhere) {
  Slabs slabs;
  EXPECT_NE(slabs.Allocate(0), nullptr);
}

}  // namespace
}  // namespace glint
