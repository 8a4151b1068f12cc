#include "common/domain/direction_grid.h"

#include <gtest/gtest.h>

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
