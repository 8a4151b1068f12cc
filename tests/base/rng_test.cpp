#include "common/base/rng.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>

namespace glint {
namespace {

using Words = std::array<uint32_t, 4>;

// Known answers that the generator's authors publish with it (Salmon et al. 2011, Random123).
TEST(PhiloxTest, KnownAnswers) {
  EXPECT_EQ(Philox4x32({0, 0, 0, 0}, {0, 0}), (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr uint32_t kOnes = 0xffffffff;
  EXPECT_EQ(Philox4x32({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
            (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(Philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(OpenUniformTest, StaysInsideTheOpenInterval) {
  EXPECT_GT(OpenUniform(0), 0.0f);
  EXPECT_LT(OpenUniform(0xffffffff), 1.0f);
  EXPECT_FLOAT_EQ(OpenUniform(0), 0x1p-24f);
  EXPECT_FLOAT_EQ(OpenUniform(0x80000000u), 0.5f);
}

TEST(CounterRngTest, DrawsTheWordsOfSuccessiveCounters) {
  CounterRng rng(0x299f31d0a4093822u, 7, 8, 9);
  for (uint32_t block = 0; block < 3; ++block) {
    for (const uint32_t word : Philox4x32({block, 7, 8, 9}, {0xa4093822, 0x299f31d0}))
      EXPECT_EQ(rng.Bits(), word);
  }
}

TEST(CounterRngTest, StreamsDifferInEveryArgument) {
  std::set<uint32_t> first;
  first.insert(CounterRng(1, 2, 3, 4).Bits());
  first.insert(CounterRng(2, 2, 3, 4).Bits());
  first.insert(CounterRng(uint64_t{1} << 32 | 1, 2, 3, 4).Bits());
  first.insert(CounterRng(1, 3, 3, 4).Bits());
  first.insert(CounterRng(1, 2, 4, 4).Bits());
  first.insert(CounterRng(1, 2, 3, 5).Bits());
  EXPECT_EQ(first.size(), 6u);
}

TEST(CounterRngTest, UniformHasMeanAndVarianceOfTheUnitInterval) {
  constexpr int kDraws = 1 << 16;
  CounterRng rng(1, 0);
  double sum = 0, sum2 = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double u = rng.Uniform();
    sum += u;
    sum2 += u * u;
  }
  const double mean = sum / kDraws;
  // Five standard deviations of the two estimates.
  EXPECT_NEAR(mean, 0.5, 5 * std::sqrt(1.0 / 12 / kDraws));
  EXPECT_NEAR(sum2 / kDraws - mean * mean, 1.0 / 12, 5 * std::sqrt(1.0 / 180 / kDraws));
}

}  // namespace
}  // namespace glint
