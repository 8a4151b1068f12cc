#include "worker/light_groups.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"
#include "common/base/rng.h"
#include "common/lobes/vmf.h"

namespace glint {
namespace {

class Samples : public LightSamples {
 public:
  void Add(float strength, const glm::vec3& direction, const glm::vec3& colour = glm::vec3(1)) {
    LightSamples::Add(strength / Luminance(colour) * colour, strength * direction);
  }
  /// `count` directions drawn from a lobe, of strength 1 / count each.
  void AddLobe(const Vmf& lobe, int count, const glm::vec3& colour, uint64_t seed) {
    CounterRng rng(seed, 1);
    for (int i = 0; i < count; ++i) {
      const float u = rng.Uniform(), v = rng.Uniform();
      Add(1.0f / static_cast<float>(count), SampleVmf(lobe, u, v), colour);
    }
  }
};

LightGroup Sum(const LightGroups& groups) {
  LightGroup sum;
  for (const LightGroup& g : groups) sum += g;
  return sum;
}

void ExpectSame(const LightGroup& a, const LightGroup& b) {
  const double scale = 2e-6 * std::max(1e-30, b.strength);
  EXPECT_NEAR(a.strength, b.strength, scale);
  EXPECT_LT(glm::distance(a.moment, b.moment), 2 * scale);
  EXPECT_LT(glm::distance(a.colour, b.colour), 20 * scale);
}

LightGroups Group(Samples* samples) {
  const LightList list = samples->List();
  const LightGroups groups = GroupLight(kGatherKernelsBase, list, samples->total(), 0);
  ExpectSame(Sum(groups), samples->total());
  const LightGroups again = GroupLight(SelectGatherKernels(), list, samples->total(), 0);
  EXPECT_EQ(groups.size(), again.size());
  for (const LightGroup& g : groups) EXPECT_GT(g.strength, 0);
  return groups;
}

LightGroups Join(LightGroups groups, int most, double tolerance) {
  const LightGroup before = Sum(groups);
  JoinLikeGroups(most, tolerance, &groups);
  ExpectSame(Sum(groups), before);
  EXPECT_LE(groups.size(), most);
  return groups;
}

const glm::vec3 kRed(1, 0.02f, 0.02f), kBlue(0.02f, 0.02f, 1);

TEST(LightGroupsTest, NothingIsNoGroup) {
  Samples none;
  EXPECT_EQ(Group(&none).size(), 0);
  Samples dark;
  dark.Add(0, {0, 0, 1});
  EXPECT_EQ(Group(&dark).size(), 0);
}

TEST(LightGroupsTest, IdenticalSamplesAreOneGroup) {
  Samples samples;
  for (int i = 0; i < 37; ++i) samples.Add(0.1f, glm::normalize(glm::vec3(1, 2, -3)), kRed);
  const LightGroups groups = Join(Group(&samples), 4, 1e-3);
  EXPECT_EQ(groups.size(), 1);
}

TEST(LightGroupsTest, OneSampleIsOneGroup) {
  Samples samples;
  samples.Add(0.5f, {0, 1, 0});
  EXPECT_EQ(Group(&samples).size(), 1);
}

TEST(LightGroupsTest, TwoClearClustersAreTwoLobesOfTheirOwnColours) {
  const glm::vec3 left = glm::normalize(glm::vec3(-1, 0.2f, 0.5f)),
                  right = glm::normalize(glm::vec3(1, 0, 0.5f));
  Samples samples;
  samples.AddLobe({left, 60}, 50, kRed, 1);
  samples.AddLobe({right, 60}, 50, kBlue, 2);
  const LightGroups groups = Join(Group(&samples), 4, 0.4);
  ASSERT_EQ(groups.size(), 2);
  for (const LightGroup& g : groups) {
    const bool red = g.colour.x > g.colour.z;
    const glm::vec3 mu(glm::normalize(g.moment));
    EXPECT_GT(glm::dot(mu, red ? left : right), 0.99f);
    EXPECT_NEAR(g.strength, 1, 1e-5);
    EXPECT_NEAR((red ? g.colour.z / g.colour.x : g.colour.x / g.colour.z), 0.02, 1e-4);
  }
}

TEST(LightGroupsTest, AntipodalLightIsNotAveraged) {
  Samples samples;
  samples.AddLobe({{0, 0, 1}, 30}, 40, kRed, 3);
  samples.AddLobe({{0, 0, -1}, 30}, 40, kBlue, 4);
  const LightGroups groups = Join(Group(&samples), 2, 0);
  ASSERT_EQ(groups.size(), 2);
  for (const LightGroup& g : groups) EXPECT_GT(glm::length(g.moment) / g.strength, 0.9);
}

TEST(LightGroupsTest, ExactlyOppositeDirectionsAreFinite) {
  Samples samples;
  for (int i = 0; i < 8; ++i) samples.Add(1, {0, 0, i % 2 ? 1.0f : -1.0f});
  const LightGroups groups = Join(Group(&samples), 1, 0);
  ASSERT_EQ(groups.size(), 1);
  EXPECT_NEAR(glm::length(groups[0].moment), 0, 1e-6);
  EXPECT_NEAR(groups[0].strength, 8, 1e-5);
}

TEST(LightGroupsTest, AFireflyDoesNotHideTheRest) {
  Samples samples;
  samples.AddLobe({{0, 0, 1}, 40}, 60, kBlue, 5);
  samples.Add(100, glm::normalize(glm::vec3(1, 0, 0.1f)), kRed);
  const LightGroups groups = Group(&samples);
  double red = 0;
  for (const LightGroup& g : groups)
    if (g.strength > 50) red = g.strength;
  EXPECT_NEAR(red, 100, 0.1);  // with little of what is not red
  EXPECT_GE(groups.size(), 2);
}

TEST(LightGroupsTest, ALobeStaysOneAndALongStreakDoesNot) {
  Samples lobe;
  lobe.AddLobe({glm::normalize(glm::vec3(0.2f, 0.3f, 1)), 50}, 400, glm::vec3(1), 6);
  EXPECT_EQ(Join(Group(&lobe), 4, 0.6).size(), 1);
  Samples streak;
  for (int i = 0; i < 100; ++i) {
    const float angle = 0.02f * static_cast<float>(i);
    streak.Add(0.01f, {std::sin(angle), 0, std::cos(angle)});
  }
  EXPECT_GE(Join(Group(&streak), 4, 0.5).size(), 3);
}

TEST(LightGroupsTest, FaintLightIsNotWorthALobe) {
  Samples samples;
  samples.AddLobe({{1, 0, 0}, 60}, 50, kRed, 7);
  samples.Add(0.003f, {-1, 0, 0}, kBlue);
  EXPECT_EQ(Join(Group(&samples), 4, 0.6).size(), 1);
}

TEST(LightGroupsTest, StrongestFirst) {
  LightGroups groups;
  groups.Add({0.5, {0.5, 0, 0}, glm::dvec3(0.5)});
  groups.Add({2.0, {0, 2, 0}, glm::dvec3(2)});
  groups.Add({1.0, {0, 0, 1}, glm::dvec3(1)});
  groups = Join(groups, 4, 0);
  ASSERT_EQ(groups.size(), 3);
  EXPECT_EQ(groups[0].strength, 2.0);
  EXPECT_EQ(groups[1].strength, 1.0);
  EXPECT_EQ(groups[2].strength, 0.5);
}

TEST(LightGroupsTest, FaintOrNarrowLightIsNotLookedAt) {
  const SliceLobe lobe{.mu = {0, 0, 1}, .kappa = 100};
  const auto can = [&](double strength, double mean_cosine) {
    return CanBeSplit({glm::dvec3(strength), {0, 0, strength * mean_cosine}}, lobe, 0.1);
  };
  EXPECT_TRUE(can(0.5, 0.9));
  EXPECT_TRUE(can(0.5, 0));
  EXPECT_FALSE(can(0.5, 0.9999));
  EXPECT_TRUE(can(0.5, 0.985));
  EXPECT_FALSE(can(0.5, 0.989));  // hardly wider than the lobe
  EXPECT_FALSE(can(0.001, 0));
  EXPECT_FALSE(can(0, 0));
}

}  // namespace
}  // namespace glint
