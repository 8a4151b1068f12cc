#include "coordinator/spatial/mask_directions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/rng.h"

namespace glint {
namespace {

TEST(MaskDirectionsTest, FindsTheNearestOrOneAsNear) {
  const MaskDirections directions;
  CounterRng rng(1, 0, 0, 0);
  for (int i = 0; i < 10000; ++i) {
    const glm::vec3 d(rng.Uniform() - 0.5f, rng.Uniform() - 0.5f, rng.Uniform() - 0.5f);
    const auto angle = [&](int k) {
      return std::acos(std::min(glm::dot(directions[k], glm::normalize(d)), 1.0f));
    };
    float nearest = 4;
    for (int k = 0; k < MaskDirections::kCount; ++k) nearest = std::min(nearest, angle(k));
    EXPECT_LT(angle(directions.Nearest(d)), nearest + 0.1f);
    EXPECT_LT(nearest, 0.3f) << "they are evenly spread";
  }
  for (int k = 0; k < MaskDirections::kCount; ++k) EXPECT_EQ(directions.Nearest(directions[k]), k);
}

}  // namespace
}  // namespace glint
