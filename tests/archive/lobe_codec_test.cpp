#include "common/archive/lobe_codec.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "common/base/frame.h"
#include "common/base/rng.h"

namespace glint {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

DirectLobe RoundTrip(const DirectLobe& lobe) {
  std::array<std::byte, kDirectEntryBytes> bytes;
  EncodeDirect(lobe, bytes.data());
  return DecodeDirect(bytes.data());
}

IndirectLobe RoundTrip(const IndirectLobe& lobe) {
  std::array<std::byte, kIndirectEntryBytes> bytes;
  EncodeIndirect(lobe, bytes.data());
  return DecodeIndirect(bytes.data());
}

/// Entry whose code `field` is `code`, the others being those of the default lobe.
template <class Lobe, class Encode>
std::array<std::byte, 12> WithCode(const Lobe& lobe, Encode encode, int field, uint16_t code) {
  std::array<std::byte, 12> bytes;
  encode(lobe, bytes.data());
  std::memcpy(bytes.data() + 2 * field, &code, 2);
  return bytes;
}

/// Angle between directions, exact for small ones; a need not be quite unit.
double Angle(const glm::vec3& a, const glm::dvec3& b) {
  const glm::dvec3 unit = glm::normalize(glm::dvec3(a));
  return std::atan2(glm::length(glm::cross(unit, b)), glm::dot(unit, b));
}

glm::dvec3 RandomDirection(CounterRng* rng) {
  const double z = 2 * double{rng->Uniform()} - 1, phi = 2 * 3.14159265358979 * rng->Uniform();
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

TEST(LobeCodecTest, FractionWithinBound) {
  CounterRng rng(1, 0);
  for (int i = 0; i < 200000; ++i) {
    const float x = rng.Uniform();
    ASSERT_NEAR(RoundTrip(DirectLobe{.fraction = x}).fraction, x, 7.7e-6);
  }
  for (const float exact : {0.0f, 1.0f}) EXPECT_EQ(RoundTrip(DirectLobe{.fraction = exact}).fraction, exact);
  EXPECT_EQ(RoundTrip(DirectLobe{.fraction = -kInf}).fraction, 0);
  EXPECT_EQ(RoundTrip(DirectLobe{.fraction = 1.5f}).fraction, 1);
  EXPECT_EQ(RoundTrip(DirectLobe{.fraction = kNan}).fraction, 0);
}

TEST(LobeCodecTest, ShiftWithinBound) {
  CounterRng rng(2, 0);
  for (int i = 0; i < 200000; ++i) {
    DirectLobe lobe;
    for (int k = 0; k < 3; ++k) lobe.shift[k] = 4 * rng.Uniform() - 2;
    const DirectLobe back = RoundTrip(lobe);
    for (int k = 0; k < 3; ++k) ASSERT_NEAR(back.shift[k], lobe.shift[k], 3.06e-5);
  }
  EXPECT_EQ(RoundTrip(DirectLobe{.shift = {0, 2, -2}}).shift, glm::vec3(0, 2, -2));
  EXPECT_EQ(RoundTrip(DirectLobe{.shift = {kNan, kInf, -kInf}}).shift, glm::vec3(0, 2, -2));
}

TEST(LobeCodecTest, KappaRatioWithinBound) {
  CounterRng rng(3, 0);
  for (int i = 0; i < 200000; ++i) {
    const float ratio = std::exp2(40 * rng.Uniform() - 20);
    const float back = RoundTrip(DirectLobe{.kappa_ratio = ratio}).kappa_ratio;
    ASSERT_LE(std::abs(back - ratio), 2.2e-4f * ratio) << ratio;
  }
  for (const float exact : {1.0f, 0x1p20f, 0x1p-20f}) {
    EXPECT_EQ(RoundTrip(DirectLobe{.kappa_ratio = exact}).kappa_ratio, exact);
  }
  EXPECT_EQ(RoundTrip(DirectLobe{.kappa_ratio = kInf}).kappa_ratio, 0x1p20f);
  EXPECT_EQ(RoundTrip(DirectLobe{.kappa_ratio = 0}).kappa_ratio, 0x1p-20f);
  EXPECT_EQ(RoundTrip(DirectLobe{.kappa_ratio = kNan}).kappa_ratio, 1);
}

TEST(LobeCodecTest, AlphaWithinBound) {
  CounterRng rng(4, 0);
  for (int i = 0; i < 200000; ++i) {
    const float x = std::exp2(46 * rng.Uniform() - 30);
    const float clamped = std::min(x, 65504.0f);
    const float back = RoundTrip(IndirectLobe{.alpha = {x, 0, 0}}).alpha.x;
    ASSERT_LE(std::abs(back - clamped), x > 6.2e-5f ? 0x1p-11f * clamped : 3e-8f) << x;
  }
  const glm::vec3 exact(0, 1, 65504);
  EXPECT_EQ(RoundTrip(IndirectLobe{.alpha = exact}).alpha, exact);
  EXPECT_EQ(RoundTrip(IndirectLobe{.alpha = {kNan, kInf, -kInf}}).alpha, glm::vec3(0, 65504, 0));
  EXPECT_EQ(RoundTrip(IndirectLobe{.alpha = {-1, 65519, 1e30f}}).alpha, glm::vec3(0, 65504, 65504));
}

TEST(LobeCodecTest, EveryHalfDecodesAsIeeeSays) {
  for (uint32_t code = 0; code <= kMaxHalf; ++code) {
    const int exponent = static_cast<int>(code >> 10), mantissa = static_cast<int>(code & 1023);
    const double want =
        exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
    ASSERT_EQ(DecodeHalf(static_cast<uint16_t>(code)), want) << code;
  }
}

TEST(LobeCodecTest, HalvesRoundToNearestEven) {
  for (uint32_t code = 0; code < kMaxHalf; ++code) {
    const float low = DecodeHalf(static_cast<uint16_t>(code));
    const float high = DecodeHalf(static_cast<uint16_t>(code + 1));
    const float middle = (low + high) / 2;  // exact in float
    const auto alpha = [](float x) { return RoundTrip(IndirectLobe{.alpha = {x, 0, 0}}).alpha.x; };
    ASSERT_EQ(alpha(middle), code % 2 == 0 ? low : high);
    ASSERT_EQ(alpha(std::nextafter(middle, 0.0f)), low);
    ASSERT_EQ(alpha(std::nextafter(middle, 1e9f)), high);
  }
}

TEST(LobeCodecTest, DirectionWithinBound) {
  CounterRng rng(5, 0);
  double largest = 0;
  for (int i = 0; i < 500000; ++i) {
    const glm::dvec3 mu = RandomDirection(&rng);
    const glm::vec3 back = RoundTrip(IndirectLobe{.mu = glm::vec3(mu)}).mu;
    largest = std::max(largest, Angle(back, mu));
    ASSERT_NEAR(glm::length(back), 1, 2e-7);
  }
  EXPECT_LT(largest, 4.4e-5);
  EXPECT_GT(largest, 2e-5);  // the bound is not idle
}

TEST(LobeCodecTest, DirectionsOnSeamsAndAxes) {
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        for (const float nudge : {0.0f, 1e-7f, -1e-7f, 1e-4f, -1e-4f}) {
          const glm::dvec3 mu = glm::normalize(glm::dvec3(x + nudge, y - nudge, z + 2 * nudge));
          EXPECT_LT(Angle(RoundTrip(IndirectLobe{.mu = glm::vec3(mu)}).mu, mu), 4.4e-5);
        }
        if (std::abs(x) + std::abs(y) + std::abs(z) == 1) {
          EXPECT_EQ(RoundTrip(IndirectLobe{.mu = glm::vec3(x, y, z)}).mu, glm::vec3(x, y, z));
        }
      }
    }
  }
  for (const glm::vec3 bad : {glm::vec3(0), glm::vec3(kNan, 0, 1), glm::vec3(kInf, 0, 0)}) {
    EXPECT_EQ(RoundTrip(IndirectLobe{.mu = bad}).mu, glm::vec3(0, 0, 1));
  }
}

TEST(LobeCodecTest, KappaWithinBound) {
  CounterRng rng(6, 0);
  for (int i = 0; i < 200000; ++i) {
    const float kappa = 1e-3f * std::pow(10.0f, 9 * rng.Uniform());
    const float back = RoundTrip(IndirectLobe{.kappa = kappa}).kappa;
    ASSERT_LE(std::abs(back - kappa), 1.6e-4f * kappa) << kappa;
  }
  EXPECT_EQ(RoundTrip(IndirectLobe{.kappa = 0}).kappa, 0);
  EXPECT_EQ(RoundTrip(IndirectLobe{.kappa = 9.9e-4f}).kappa, 0);
  EXPECT_EQ(RoundTrip(IndirectLobe{.kappa = kNan}).kappa, 0);
  EXPECT_EQ(RoundTrip(IndirectLobe{.kappa = -1}).kappa, 0);
  EXPECT_NEAR(RoundTrip(IndirectLobe{.kappa = kMaxKappa}).kappa, kMaxKappa, 0.1);
  EXPECT_NEAR(RoundTrip(IndirectLobe{.kappa = kInf}).kappa, kMaxKappa, 0.1);
}

TEST(LobeCodecTest, LogCodesAscend) {
  float ratio = 0, kappa = -1;
  for (uint32_t code = 1; code <= 65535; ++code) {
    const auto c = static_cast<uint16_t>(code);
    const float r = DecodeDirect(WithCode(DirectLobe{}, EncodeDirect, 1, c).data()).kappa_ratio;
    const float k = DecodeIndirect(WithCode(IndirectLobe{}, EncodeIndirect, 5, c).data()).kappa;
    ASSERT_GT(r, ratio);
    ASSERT_GT(k, kappa);
    ratio = r, kappa = k;
  }
}

TEST(LobeCodecTest, EveryLogCodeIsStable) {
  for (uint32_t code = 0; code <= 65535; ++code) {
    const auto c = static_cast<uint16_t>(code);
    ASSERT_EQ(IsCanonicalDirect(WithCode(DirectLobe{}, EncodeDirect, 1, c).data()), code > 0) << code;
    ASSERT_TRUE(IsCanonicalIndirect(WithCode(IndirectLobe{}, EncodeIndirect, 5, c).data())) << code;
  }
}

/// Every code of every field: finite, within its range, and the encoder's image is stable.
TEST(LobeCodecTest, AnyBytesDecodeWithinRangesAndStably) {
  CounterRng rng(7, 0);
  for (uint32_t code = 0; code < 65536 * 6; ++code) {
    const int field = static_cast<int>(code >> 16);
    std::array<std::byte, 12> bytes;
    for (std::byte& b : bytes) b = static_cast<std::byte>(rng.Bits() & 255);
    const auto c = static_cast<uint16_t>(code);
    std::memcpy(bytes.data() + 2 * field, &c, 2);

    const DirectLobe direct = DecodeDirect(bytes.data());
    ASSERT_TRUE(direct.fraction >= 0 && direct.fraction <= 1);
    ASSERT_TRUE(direct.kappa_ratio >= 0x1p-20f && direct.kappa_ratio <= 0x1p20f);
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(std::abs(direct.shift[k]) <= 2);
    const IndirectLobe indirect = DecodeIndirect(bytes.data());
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(indirect.alpha[k] >= 0 && indirect.alpha[k] <= 65504);
    ASSERT_NEAR(glm::length(indirect.mu), 1, 2e-7);
    ASSERT_TRUE(indirect.kappa >= 0 && indirect.kappa <= kMaxKappa);

    std::array<std::byte, 12> encoded;
    EncodeDirect(direct, encoded.data());
    ASSERT_TRUE(IsCanonicalDirect(encoded.data()));
    ASSERT_EQ(IsCanonicalDirect(bytes.data()), encoded == bytes);
    EncodeIndirect(indirect, encoded.data());
    ASSERT_TRUE(IsCanonicalIndirect(encoded.data()));
    ASSERT_EQ(IsCanonicalIndirect(bytes.data()), encoded == bytes) << code;
  }
}

TEST(LobeCodecTest, EveryBorderCodeIsCanonicalOrNamesAnother) {
  for (int i = -32767; i <= 32767; ++i) {
    for (const int border : {-32767, 32767}) {
      for (const bool swap : {false, true}) {
        std::array<std::byte, 12> bytes, encoded;
        EncodeIndirect(IndirectLobe{}, bytes.data());
        const auto along = static_cast<int16_t>(i), across = static_cast<int16_t>(border);
        std::memcpy(bytes.data() + 6, swap ? &along : &across, 2);
        std::memcpy(bytes.data() + 8, swap ? &across : &along, 2);
        EncodeIndirect(DecodeIndirect(bytes.data()), encoded.data());
        ASSERT_EQ(IsCanonicalIndirect(bytes.data()), encoded == bytes) << i << " " << border << " " << swap;
        ASSERT_TRUE(IsCanonicalIndirect(encoded.data()));
      }
    }
  }
}

// ---- Fewer bytes ----

/// Bounds of an entry of some bytes, as docs/archive-format.md states them.
struct PackedBounds {
  uint32_t bytes;
  float fraction, ratio, shift, alpha, mu, kappa;
};
constexpr PackedBounds kPackedBounds[] = {{8, 1.4e-4f, 2.0e-3f, 2.9e-4f, 0x1.4p-9f, 4.2e-3f, 2.8e-3f},
                                          {6, 1.0e-3f, 2.8e-2f, 2.1e-3f, 0x1.1p-6f, 1.7e-2f, 2.1e-2f}};

class PackedEntryTest : public testing::TestWithParam<PackedBounds> {
 protected:
  DirectLobe Packed(const DirectLobe& lobe) const {
    std::array<std::byte, 12> whole, packed;
    EncodeDirect(lobe, whole.data());
    PackDirect(whole.data(), GetParam().bytes, packed.data());
    return DecodeDirect(packed.data(), GetParam().bytes);
  }
  IndirectLobe Packed(const IndirectLobe& lobe) const {
    std::array<std::byte, 12> whole, packed;
    EncodeIndirect(lobe, whole.data());
    PackIndirect(whole.data(), GetParam().bytes, packed.data());
    return DecodeIndirect(packed.data(), GetParam().bytes);
  }
};

TEST_P(PackedEntryTest, KeepsItsBounds) {
  const PackedBounds& bounds = GetParam();
  CounterRng rng(11, 0);
  const auto between = [&](float low, float high) { return low + (high - low) * rng.Uniform(); };
  for (int i = 0; i < 200000; ++i) {
    const DirectLobe direct{
        rng.Uniform(), {between(-2, 2), between(-2, 2), between(-2, 2)}, std::exp2(between(-19.9f, 19.9f))};
    const DirectLobe d = Packed(direct);
    ASSERT_NEAR(d.fraction, direct.fraction, bounds.fraction);
    ASSERT_NEAR(d.kappa_ratio / direct.kappa_ratio, 1, bounds.ratio);
    for (int k = 0; k < 3; ++k) ASSERT_NEAR(d.shift[k], direct.shift[k], bounds.shift);

    const float z = between(-1, 1), phi = between(0, 6.2831853f), r = std::sqrt(1 - z * z);
    const float scale = std::exp2(between(-12, 15));
    const IndirectLobe indirect{scale * glm::vec3(rng.Uniform(), rng.Uniform(), rng.Uniform()),
                                {r * std::cos(phi), r * std::sin(phi), z},
                                std::exp2(between(-9.9f, 19.9f))};
    const IndirectLobe l = Packed(indirect);
    const float largest = std::max({indirect.alpha.x, indirect.alpha.y, indirect.alpha.z});
    for (int k = 0; k < 3; ++k) ASSERT_NEAR(l.alpha[k], indirect.alpha[k], bounds.alpha * largest);
    ASSERT_LT(glm::length(l.mu - indirect.mu), bounds.mu);
    ASSERT_NEAR(l.kappa / indirect.kappa, 1, bounds.kappa);
  }
}

TEST_P(PackedEntryTest, ExactValuesStayExact) {
  for (const float fraction : {0.0f, 1.0f}) {
    const DirectLobe lobe = Packed(DirectLobe{.fraction = fraction});
    EXPECT_EQ(lobe.fraction, fraction);
    EXPECT_EQ(lobe.shift, glm::vec3(0));
    EXPECT_EQ(lobe.kappa_ratio, 1);
  }
  const IndirectLobe dark = Packed(IndirectLobe{});
  EXPECT_EQ(dark.alpha, glm::vec3(0));
  EXPECT_EQ(dark.mu, glm::vec3(0, 0, 1));
  EXPECT_EQ(dark.kappa, 0);
  EXPECT_EQ(Packed(IndirectLobe{glm::vec3(1, 0.5f, 0), {1, 0, 0}, 1}).alpha, glm::vec3(1, 0.5f, 0));
}

TEST_P(PackedEntryTest, AnyBytesDecodeWithinRangesAndStably) {
  const uint32_t bytes = GetParam().bytes;
  CounterRng rng(12, 0);
  for (int i = 0; i < 300000; ++i) {
    std::array<std::byte, 12> in{}, whole{}, again{}, twice{};
    for (uint32_t b = 0; b < bytes; ++b) in[b] = static_cast<std::byte>(rng.Bits() & 255);
    const DirectLobe direct = DecodeDirect(in.data(), bytes);
    ASSERT_TRUE(direct.fraction >= 0 && direct.fraction <= 1);
    ASSERT_TRUE(direct.kappa_ratio >= 0x1p-20f && direct.kappa_ratio <= 0x1p20f);
    for (int k = 0; k < 3; ++k) ASSERT_LE(std::abs(direct.shift[k]), 2);
    EncodeDirect(direct, whole.data());
    PackDirect(whole.data(), bytes, again.data());
    ASSERT_EQ(IsCanonicalDirect(in.data(), bytes), in == again);
    ASSERT_TRUE(IsCanonicalDirect(again.data(), bytes));

    const IndirectLobe indirect = DecodeIndirect(in.data(), bytes);
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(indirect.alpha[k] >= 0 && indirect.alpha[k] <= 65504);
    ASSERT_NEAR(glm::length(indirect.mu), 1, 2e-7);
    ASSERT_TRUE(indirect.kappa >= 0 && indirect.kappa <= kMaxKappa);
    EncodeIndirect(indirect, whole.data());
    PackIndirect(whole.data(), bytes, again.data());
    ASSERT_TRUE(IsCanonicalIndirect(again.data(), bytes));
    // Rounding what was rounded gives the same bytes: nothing drifts.
    EncodeIndirect(DecodeIndirect(again.data(), bytes), whole.data());
    PackIndirect(whole.data(), bytes, twice.data());
    ASSERT_EQ(again, twice);
  }
}

INSTANTIATE_TEST_SUITE_P(Bytes, PackedEntryTest, testing::ValuesIn(kPackedBounds));

TEST(LobeCodecTest, ReservedCodesAreNotCanonical) {
  const auto direct = [](int field, uint16_t code) {
    return WithCode(DirectLobe{}, EncodeDirect, field, code);
  };
  const auto indirect = [](int field, uint16_t code) {
    return WithCode(IndirectLobe{}, EncodeIndirect, field, code);
  };
  EXPECT_TRUE(IsCanonicalDirect(direct(1, 1).data()));
  EXPECT_FALSE(IsCanonicalDirect(direct(1, 0).data()));
  EXPECT_FALSE(IsCanonicalDirect(direct(2, 0x8000).data()));
  EXPECT_FALSE(IsCanonicalDirect(direct(5, 1).data()));
  EXPECT_TRUE(IsCanonicalIndirect(indirect(0, 0x7BFF).data()));
  EXPECT_FALSE(IsCanonicalIndirect(indirect(0, 0x7C00).data()));
  EXPECT_FALSE(IsCanonicalIndirect(indirect(1, 0x8001).data()));
  EXPECT_FALSE(IsCanonicalIndirect(indirect(3, 0x8000).data()));
}

}  // namespace
}  // namespace glint
