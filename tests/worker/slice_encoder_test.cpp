#include "worker/slice_encoder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>

#include "common/lobes/vmf.h"

namespace glint {
namespace {

constexpr float kDrop = 1.0f / 1024;

SliceLobe MakeLobe(float kappa, float resolution = 1) {
  SliceLobe lobe;
  lobe.mu = glm::normalize(glm::vec3(0.3f, -0.4f, 0.85f));
  lobe.kappa = kappa;
  lobe.resolution = resolution;
  return lobe;
}

/// First moment of `weight` of a lobe around mu.
glm::dvec3 Moment(double weight, float kappa, const glm::vec3& mu) {
  return weight * (1 - static_cast<double>(DeltaFromKappa(kappa))) * glm::dvec3(glm::normalize(mu));
}

TEST(FitDirectTest, HardlyBlockedSlicesAreFree) {
  const SliceLobe lobe = MakeLobe(50);
  EXPECT_FALSE(FitDirect(lobe, {1, Moment(1, 50, lobe.mu)}, kDrop));
  const double visible = 1 - 0.5 * kDrop;
  EXPECT_FALSE(FitDirect(lobe, {visible, Moment(visible, 50, lobe.mu)}, kDrop));
  EXPECT_TRUE(FitDirect(lobe, {1 - 2 * kDrop, Moment(1 - 2 * kDrop, 50, lobe.mu)}, kDrop));
  EXPECT_TRUE(FitDirect(lobe, {visible, Moment(visible, 50, lobe.mu)}, 0));
}

TEST(FitDirectTest, HardlyVisibleSlicesAreBlack) {
  const SliceLobe lobe = MakeLobe(50);
  for (const double visible : {0.0, 0.5 * kDrop}) {
    const auto direct = FitDirect(lobe, {visible, Moment(visible, 50, lobe.mu)}, kDrop);
    ASSERT_TRUE(direct);
    EXPECT_EQ(direct->fraction, 0);
    EXPECT_EQ(direct->shift, glm::vec3(0));
    EXPECT_EQ(direct->kappa_ratio, 1);
  }
}

TEST(FitDirectTest, EvenBlockingOnlyDims) {
  for (const float kappa : {0.5f, 3.0f, 50.0f, 1e4f}) {
    const SliceLobe lobe = MakeLobe(kappa);
    const auto direct = FitDirect(lobe, {0.25, Moment(0.25, kappa, lobe.mu)}, kDrop);
    ASSERT_TRUE(direct);
    EXPECT_FLOAT_EQ(direct->fraction, 0.25f);
    EXPECT_LT(glm::length(direct->shift), 1e-5f);
    EXPECT_NEAR(direct->kappa_ratio, 1, 1e-3);  // a float delta carries a small kappa with few digits
  }
}

TEST(FitDirectTest, WhatIsLeftGivesDirectionAndWidth) {
  const SliceLobe lobe = MakeLobe(50);
  const glm::vec3 mu = glm::normalize(lobe.mu + glm::vec3(0.1f, 0.05f, 0));
  const auto direct = FitDirect(lobe, {0.6, Moment(0.6, 90, mu)}, kDrop);
  ASSERT_TRUE(direct);
  EXPECT_FLOAT_EQ(direct->fraction, 0.6f);
  EXPECT_LT(glm::distance(lobe.mu + direct->shift, mu), 1e-5f);
  EXPECT_NEAR(direct->kappa_ratio, 90.0f / 50.0f, 1e-3);
}

TEST(FitDirectTest, AHandfulOfSamplesIsNoSharperThanAQuarterOfTheLobesWidth) {
  for (const float kappa : {1.0f, 50.0f, 1e4f}) {
    const SliceLobe lobe = MakeLobe(kappa);
    const auto direct = FitDirect(lobe, {0.01, glm::dvec3(lobe.mu) * 0.01}, kDrop);
    ASSERT_TRUE(direct);
    EXPECT_LE(direct->kappa_ratio, 16.01f) << kappa;
    EXPECT_GE(direct->kappa_ratio, 15.0f) << kappa;
  }
}

TEST(FitDirectTest, LobesBroaderThanTheRealOneAreTakenInProportion) {
  // Gathered with a quarter of the kappa: an edge at the same place of the lobe lies at half the angle.
  const SliceLobe lobe = MakeLobe(400, 0.25f);
  const glm::vec3 mu = glm::normalize(lobe.mu + glm::vec3(0.08f, 0.06f, 0));
  const auto direct = FitDirect(lobe, {0.5, Moment(0.5, 100, mu)}, kDrop);
  ASSERT_TRUE(direct);
  EXPECT_NEAR(direct->kappa_ratio, 1, 1e-3);
  EXPECT_LT(glm::distance(direct->shift, 0.5f * (mu - lobe.mu)), 1e-5f);
}

TEST(FitDirectTest, AlwaysInRange) {
  for (const float kappa : {0.0f, 1e-6f, 1.0f, kMaxKappa})
    for (const glm::dvec3& mean : {glm::dvec3(0), glm::dvec3(0.5, 0, 0), glm::dvec3(0, -1, 0)}) {
      const auto direct = FitDirect(MakeLobe(kappa), {0.5, mean}, kDrop);
      ASSERT_TRUE(direct);
      EXPECT_TRUE(direct->kappa_ratio >= 0x1p-20f && direct->kappa_ratio <= 0x1p20f) << kappa;
      for (int c = 0; c < 3; ++c) EXPECT_LE(std::abs(direct->shift[c]), 2.0f);
    }
}

TEST(FitIndirectTest, FaintLightIsLeftOut) {
  const SliceLobe lobe = MakeLobe(50);
  EXPECT_FALSE(FitIndirect(lobe, {}, kDrop));
  EXPECT_FALSE(FitIndirect(lobe, {glm::dvec3(0.5 * kDrop), Moment(0.5 * kDrop, 9, lobe.mu)}, kDrop));
  // One channel is enough.
  const glm::dvec3 blue(0, 0, 2 * kDrop);
  EXPECT_TRUE(FitIndirect(lobe, {blue, Moment(0.0722 * blue.z, 9, lobe.mu)}, kDrop));
}

TEST(FitIndirectTest, MomentsGiveTheLobe) {
  const SliceLobe lobe = MakeLobe(200);
  const glm::dvec3 alpha(0.8, 0.4, 0.2);
  const double luminance = 0.2126 * alpha.x + 0.7152 * alpha.y + 0.0722 * alpha.z;
  const glm::vec3 mu = glm::normalize(glm::vec3(-0.7f, 0.1f, 0.2f));
  const auto indirect = FitIndirect(lobe, {alpha, Moment(luminance, 25, mu)}, kDrop);
  ASSERT_TRUE(indirect);
  EXPECT_LT(glm::distance(indirect->alpha, glm::vec3(alpha)), 1e-6f);
  EXPECT_LT(glm::distance(indirect->mu, mu), 1e-5f);
  EXPECT_NEAR(indirect->kappa, 25, 0.01);
}

TEST(FitIndirectTest, LightFromEverywhereHasNoDirection) {
  const auto indirect = FitIndirect(MakeLobe(200), {glm::dvec3(0.5), glm::dvec3(0)}, kDrop);
  ASSERT_TRUE(indirect);
  EXPECT_EQ(indirect->kappa, 0);
  EXPECT_NEAR(glm::length(indirect->mu), 1, 1e-6);
}

TEST(StoreTest, OnlyWhatThereIsTakesRoom) {
  BlockRows rows;
  rows.BeginRow();
  StoreDirect(std::nullopt, 3, &rows);
  EXPECT_TRUE(rows.columns.empty() && rows.entries.empty());
  const DirectLobe lobe{0.5f, glm::vec3(0.1f, -0.2f, 0.3f), 1.5f};
  StoreDirect(lobe, 4, &rows);
  rows.BeginRow();
  StoreDirect(DirectLobe{.fraction = 0}, 7, &rows);
  EXPECT_EQ(rows.counts, (std::vector<uint16_t>{1, 1}));
  EXPECT_EQ(rows.columns, (std::vector<uint16_t>{4, 7}));
  ASSERT_EQ(rows.entries.size(), 2 * kDirectEntryBytes);
  EXPECT_NEAR(DecodeDirect(rows.entries.data()).fraction, lobe.fraction, 1e-5);
  EXPECT_EQ(DecodeDirect(rows.entries.data() + kDirectEntryBytes).fraction, 0);

  BlockRows indirect;
  indirect.BeginRow();
  StoreIndirect(std::nullopt, 0, &indirect);
  StoreIndirect(IndirectLobe{glm::vec3(0.5f), {0, 1, 0}, 8}, 1, &indirect);
  EXPECT_EQ(indirect.columns, (std::vector<uint16_t>{1}));
  EXPECT_NEAR(DecodeIndirect(indirect.entries.data()).kappa, 8, 0.01);
}

}  // namespace
}  // namespace glint
