#include "common/domain/direction_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"
#include "common/base/rng.h"

namespace glint {
namespace {

glm::vec3 RandomDirection(CounterRng* rng) {
  const float z = 2 * rng->Uniform() - 1, phi = 2 * kPi * rng->Uniform(), r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

class DirectionGridTest : public testing::TestWithParam<int> {};

TEST_P(DirectionGridTest, HasTheGeodesicCountOfUnitDirections) {
  const DirectionGrid grid(GetParam());
  EXPECT_EQ(grid.size(), 10u * (1u << (2 * GetParam())) + 2);
  EXPECT_EQ(grid.triangles().size(), 20u << (2 * GetParam()));
  EXPECT_EQ(DirectionGrid::LevelOf(grid.size()), GetParam());
  for (const glm::vec3& d : grid.directions()) EXPECT_NEAR(glm::length(d), 1, 1e-6);
}

TEST_P(DirectionGridTest, LocateGivesTheTriangleAroundADirection) {
  const DirectionGrid grid(GetParam());
  CounterRng rng(7, 0);
  for (int i = 0; i < 20000; ++i) {
    const glm::vec3 d = RandomDirection(&rng);
    const DirectionGrid::Location at = grid.Locate(d);
    glm::vec3 sum(0);
    float total = 0;
    for (int k = 0; k < 3; ++k) {
      EXPECT_GE(at.weight[k], 0);
      total += at.weight[k];
      sum += at.weight[k] * grid.direction(at.index[k]);
    }
    EXPECT_NEAR(total, 1, 1e-5);
    EXPECT_GT(glm::dot(glm::normalize(sum), d), 1 - 1e-6);
  }
}

TEST_P(DirectionGridTest, LocateReproducesTheGridsOwnDirections) {
  const DirectionGrid grid(GetParam());
  for (uint32_t i = 0; i < grid.size(); ++i) {
    const DirectionGrid::Location at = grid.Locate(grid.direction(i));
    float own = 0;
    for (int k = 0; k < 3; ++k) own += at.index[k] == i ? at.weight[k] : 0;
    EXPECT_NEAR(own, 1, 4e-4) << "direction " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Levels, DirectionGridTest, testing::Range(0, DirectionGrid::kMaxLevel + 1));

class NestedDirectionGridTest : public testing::TestWithParam<int> {};

TEST_P(NestedDirectionGridTest, LevelsFollowOneAnother) {
  constexpr int kLevel = 4;
  const DirectionGrid grid(kLevel, GetParam()), plain(kLevel);
  EXPECT_EQ(grid.base_level(), GetParam());
  EXPECT_TRUE(grid.nested());
  EXPECT_FALSE(plain.nested());
  ASSERT_EQ(grid.size(), plain.size());
  for (int level = GetParam(); level <= kLevel; ++level) {
    const DirectionGrid own(level);
    ASSERT_EQ(grid.triangles(level).size(), own.triangles().size());
    for (uint32_t i = 0; i < own.size(); ++i) {
      const DirectionGrid::Location at = grid.Locate(own.direction(i));
      for (int k = 0; k < 3; ++k)
        if (at.weight[k] > 0.5f) {
          EXPECT_LT(at.index[k], own.size()) << "level " << level;
        }
    }
  }
}

TEST_P(NestedDirectionGridTest, TrianglesHaveTheirParentsCornersAndMidpoints) {
  const DirectionGrid grid(4, GetParam());
  for (int level = GetParam() + 1; level <= 4; ++level)
    for (uint32_t t = 0; t < grid.triangles(level).size(); ++t) {
      const auto &corner = grid.triangles(level)[t], &parent = grid.triangles(level - 1)[t / 4];
      const uint32_t child = t % 4;
      for (uint32_t i = 0; i < 3; ++i) {
        if (i == child) {
          EXPECT_EQ(corner[i], parent[i]);
          continue;
        }
        const uint32_t a = parent[child < 3 ? child : i], b = parent[child < 3 ? i : (i + 1) % 3];
        const glm::vec3 middle = glm::normalize(grid.direction(a) + grid.direction(b));
        EXPECT_LT(glm::distance(grid.direction(corner[i]), middle), 1e-6f);
        const DirectionGrid::Midpoint& midpoint = grid.midpoint(corner[i]);
        EXPECT_EQ(std::minmax(a, b), std::minmax(midpoint.ends[0], midpoint.ends[1]));
        EXPECT_TRUE(midpoint.triangle[0] == t / 4 || midpoint.triangle[1] == t / 4);
        EXPECT_NE(midpoint.triangle[0], midpoint.triangle[1]);
        for (int side = 0; side < 2; ++side)
          EXPECT_EQ(grid.triangles(level)[4 * midpoint.triangle[side] + 3][midpoint.edge[side]], corner[i]);
      }
    }
}

INSTANTIATE_TEST_SUITE_P(Bases, NestedDirectionGridTest, testing::Values(0, 1, 3));

TEST(DirectionGrid, LevelOfRefusesOtherCounts) {
  EXPECT_EQ(DirectionGrid::LevelOf(0), -1);
  EXPECT_EQ(DirectionGrid::LevelOf(641), -1);
  EXPECT_EQ(DirectionGrid::LevelOf(642), 3);
}

TEST(DirectionGrid, CoarserLevelsAreNestedInFinerOnes) {
  const DirectionGrid coarse(2), fine(3);
  for (const glm::vec3& d : coarse.directions()) {
    float nearest = -1;
    for (const glm::vec3& f : fine.directions()) nearest = std::max(nearest, glm::dot(d, f));
    EXPECT_GT(nearest, 1 - 1e-6);
  }
}

}  // namespace
}  // namespace glint
