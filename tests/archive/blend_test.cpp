#include "common/archive/blend.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

namespace glint {
namespace {

/// A corner of a look-up: without lobes nothing blocks it.
struct Corner {
  float weight;
  std::vector<DirectLobe> lobes;
};

const std::vector<DirectLobe> kTwo = {{0.4f, {0.2f, 0.1f, 0}, 2}, {0.1f, {0.1f, -0.3f, 0}, 3}};
const std::vector<DirectLobe> kOthers = {
    {0.3f, {0.1f, -0.2f, 0}, 2.5f}, {0.2f, {0.3f, 0.2f, 0}, 4}, {0.1f, {-0.2f, 0, 0}, 1}};
const std::vector<DirectLobe> kOne = {{0.7f, {0.05f, 0, 0}, 1.5f}};

std::vector<DirectLobe> Blend(const std::vector<Corner>& corners) {
  SeveralBlend blend;
  for (const Corner& corner : corners) {
    if (corner.lobes.empty()) {
      blend.AddFree(corner.weight);
    } else {
      blend.Add(corner.weight, corner.lobes.data(), static_cast<int>(corner.lobes.size()));
    }
  }
  std::vector<DirectLobe> lobes;
  blend.Emit([&](const DirectLobe& lobe) { lobes.push_back(lobe); });
  return lobes;
}

struct Moments {
  float light = 0, width = 0;
  glm::vec3 shift{0};
  void Add(float weight, const DirectLobe& lobe) {
    light += weight * lobe.fraction;
    width += weight * lobe.fraction * lobe.kappa_ratio;
    shift += weight * lobe.fraction * lobe.shift;
  }
};

Moments MomentsOf(const std::vector<DirectLobe>& lobes) {
  Moments sum;
  for (const DirectLobe& lobe : lobes) sum.Add(1, lobe);
  return sum;
}

/// What the corners' moments come to.
Moments Expected(const std::vector<Corner>& corners) {
  Moments sum;
  for (const Corner& corner : corners) {
    if (corner.lobes.empty()) sum.Add(corner.weight, {});
    for (const DirectLobe& lobe : corner.lobes) sum.Add(corner.weight, lobe);
  }
  return sum;
}

void ExpectSame(const Moments& a, const Moments& b, float tolerance) {
  EXPECT_NEAR(a.light, b.light, tolerance);
  EXPECT_NEAR(a.width, b.width, 4 * tolerance);
  EXPECT_LT(glm::distance(a.shift, b.shift), tolerance);
}

/// Light that lobes send into a light of their own width about `place`, for small angles.
float Seen(const std::vector<DirectLobe>& lobes, const glm::vec3& place) {
  float sum = 0;
  for (const DirectLobe& lobe : lobes) {
    const glm::vec3 d = lobe.shift - place;
    const float kappa = 20 * lobe.kappa_ratio / (1 + lobe.kappa_ratio);
    sum += lobe.fraction * kappa * std::exp(-0.5f * kappa * glm::dot(d, d));
  }
  return sum;
}

TEST(SeveralBlendTest, OneLobeEachIsTheBlendOfThem) {
  DirectBlend plain;
  plain.AddFree(0.25f);
  plain.Add(0.75f, kOne[0]);
  const std::vector<DirectLobe> lobes = Blend({{0.25f, {}}, {0.75f, kOne}});
  ASSERT_EQ(lobes.size(), 1u);
  EXPECT_EQ(lobes[0].fraction, plain.Lobe().fraction);
  EXPECT_EQ(lobes[0].shift, plain.Lobe().shift);
  EXPECT_EQ(lobes[0].kappa_ratio, plain.Lobe().kappa_ratio);
  const std::vector<DirectLobe> free = Blend({{0.5f, {}}, {0.5f, {}}});
  ASSERT_EQ(free.size(), 1u);
  EXPECT_EQ(free[0].fraction, 1);
}

TEST(SeveralBlendTest, ACornersOwnLobesComeBack) {
  const std::vector<DirectLobe> lobes = Blend({{1, kTwo}});
  ASSERT_EQ(lobes.size(), kTwo.size());
  for (size_t i = 0; i < lobes.size(); ++i) {
    EXPECT_NEAR(lobes[i].fraction, kTwo[i].fraction, 1e-6f);
    EXPECT_LT(glm::distance(lobes[i].shift, kTwo[i].shift), 1e-6f);
    EXPECT_NEAR(lobes[i].kappa_ratio, kTwo[i].kappa_ratio, 1e-5f);
  }
}

TEST(SeveralBlendTest, LightAndFirstMomentAreInterpolated) {
  for (const float w : {0.0f, 0.1f, 0.5f, 0.9f, 1.0f})
    for (const auto& other : {std::vector<DirectLobe>{}, kOne, kOthers}) {
      const std::vector<Corner> corners = {{w, kTwo}, {0.5f * (1 - w), other}, {0.5f * (1 - w), {}}};
      ExpectSame(MomentsOf(Blend(corners)), Expected(corners), 2e-6f);
    }
}

TEST(SeveralBlendTest, TheUnoccludedLobeIsReadOnce) {
  // Beside a corner that is next to nothing all of the other's light stays where it was.
  const std::vector<DirectLobe> lobes = Blend({{0.999f, {}}, {0.001f, kTwo}});
  EXPECT_EQ(lobes.size(), 2u);
  float light = 0;
  for (const DirectLobe& lobe : lobes) {
    light += lobe.fraction;
    EXPECT_LT(glm::length(lobe.shift), 1e-3f);
    EXPECT_NEAR(lobe.kappa_ratio, 1, 1e-2f);
  }
  EXPECT_NEAR(light, 0.999f + 0.001f * 0.5f, 1e-5f);
}

TEST(SeveralBlendTest, NothingJumpsBetweenFreeOneAndSeveral) {
  constexpr int kSteps = 4000;
  const std::vector<std::vector<Corner>> ends = {{{1, {}}}, {{1, kOne}}, {{1, kTwo}}, {{1, kOthers}}};
  for (size_t from = 0; from < 2; ++from)
    for (size_t to = 1; to < ends.size(); ++to)
      for (const glm::vec3& place : {glm::vec3(0), glm::vec3(0.3f, 0.1f, 0), glm::vec3(0.1f, -0.4f, 0)}) {
        float before = Seen(Blend(ends[from]), place);
        for (int i = 0; i <= kSteps; ++i) {
          const float w = static_cast<float>(i) / kSteps;
          const float seen = Seen(Blend({{1 - w, ends[from][0].lobes}, {w, ends[to][0].lobes}}), place);
          EXPECT_LT(std::abs(seen - before), 0.02f) << from << " " << to << " " << w;
          before = seen;
        }
        EXPECT_NEAR(before, Seen(Blend(ends[to]), place), 1e-4f);
      }
}

TEST(SeveralBlendTest, BlackCornersAreBlack) {
  const std::vector<DirectLobe> dark = {{0, {0, 0, 0}, 1}, {0, {0, 0, 0}, 1}};
  for (const DirectLobe& lobe : Blend({{1, dark}})) EXPECT_EQ(lobe.fraction, 0);
  ExpectSame(MomentsOf(Blend({{0.5f, dark}, {0.5f, {}}})), {0.5f, 0.5f, glm::vec3(0)}, 1e-6f);
}

}  // namespace
}  // namespace glint
