#include "common/archive/nested.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <vector>

#include "common/base/frame.h"
#include "common/base/rng.h"

namespace glint {
namespace {

constexpr int kLevel = 4;

/// A value for some of a nested grid's directions, read between them.
class NestedTest : public testing::TestWithParam<int> {
 protected:
  NestedTest() : grid_(kLevel, GetParam()), stored_(grid_.size(), 0), value_(grid_.size(), 0) {}

  /// Stores a smooth function at all directions of the base level and at every `step`-th beyond.
  void Store(uint32_t step) {
    for (uint32_t d = 0; d < grid_.size(); ++d) {
      stored_[d] = d < DirectionGrid::SizeOf(grid_.base_level()) || d % step == 0;
      value_[d] = Function(grid_.direction(d));
    }
  }
  static float Function(const glm::vec3& d) { return 2 + d.x * d.y + d.z; }

  float Read(const DirectionGrid::Location& at, const glm::vec3& normal) const {
    float sum = 0, total = 0;
    int visits = 0;
    VisitStandIns(
        grid_, kLevel, at.triangle, at.weight,
        [&](uint32_t d) { return glm::dot(normal, grid_.direction(d)) > 0; },
        [&](uint32_t d) { return stored_[d] ? &value_[d] : nullptr; },
        [&](uint32_t, float w, const float* value) {
          EXPECT_GT(w, 0);
          EXPECT_NE(value, nullptr);
          sum += w * *value;
          total += w;
          ++visits;
        });
    EXPECT_NEAR(total, 1, 1e-5);
    EXPECT_LE(visits, kMaxStandIns);
    return sum;
  }

  glm::vec3 RandomDirection(CounterRng* rng) const {
    const float z = 2 * rng->Uniform() - 1, phi = 2 * kPi * rng->Uniform(), r = std::sqrt(1 - z * z);
    return {r * std::cos(phi), r * std::sin(phi), z};
  }

  const DirectionGrid grid_;
  std::vector<uint8_t> stored_;
  std::vector<float> value_;
};

TEST_P(NestedTest, StandInsInterpolate) {
  for (const uint32_t step : {1u, 3u, 1000000u}) {
    Store(step);
    CounterRng rng(11, step);
    double error = 0;
    for (int i = 0; i < 2000; ++i) {
      const glm::vec3 d = RandomDirection(&rng);
      error = std::max<double>(error, std::abs(Read(grid_.Locate(d), glm::vec3(0)) - Function(d)));
    }
    // The error of linear interpolation goes with the square of the edges that it comes down to.
    const int level = step == 1 ? kLevel : grid_.base_level();
    EXPECT_LT(error, std::ldexp(0.5, -2 * level)) << step;
  }
}

/// From both sides of an edge the same is read, however differently the two triangles are filled.
TEST_P(NestedTest, ThereAreNoSeams) {
  Store(3);
  CounterRng rng(12, 0);
  const auto& triangles = grid_.triangles();
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> triangle_of;
  for (uint32_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) triangle_of[{triangles[t][i], triangles[t][(i + 1) % 3]}] = t;
  for (uint32_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const uint32_t a = triangles[t][i], b = triangles[t][(i + 1) % 3], other = triangle_of.at({b, a});
      const float u = rng.Uniform();
      const auto read = [&](uint32_t triangle) {
        DirectionGrid::Location at{triangles[triangle], {}, triangle};
        for (int k = 0; k < 3; ++k) at.weight[k] = at.index[k] == a ? u : at.index[k] == b ? 1 - u : 0;
        return Read(at, glm::vec3(0));
      };
      ASSERT_NEAR(read(t), read(other), 1e-5);
    }
}

/// A slice under the horizon is never read for one above.
TEST_P(NestedTest, TheHorizonIsNotCrossed) {
  Store(5);
  const glm::vec3 normal = glm::normalize(glm::vec3(0.3f, -0.2f, 0.8f));
  for (uint32_t d = 0; d < grid_.size(); ++d)
    if (glm::dot(normal, grid_.direction(d)) <= 0) value_[d] = 1e6f;
  CounterRng rng(13, 0);
  int grazing = 0;
  for (int i = 0; i < 4000; ++i) {
    DirectionGrid::Location at = grid_.Locate(RandomDirection(&rng));
    float total = 0;
    for (int k = 0; k < 3; ++k) {
      if (glm::dot(normal, grid_.direction(at.index[k])) <= 0) at.weight[k] = 0;
      total += at.weight[k];
    }
    if (total <= 0) continue;
    grazing += total < 1;
    for (float& w : at.weight) w /= total;
    EXPECT_LT(Read(at, normal), 10);
  }
  EXPECT_GT(grazing, 50);
}

TEST_P(NestedTest, PredictionsAreWhatIsRead) {
  Store(4);
  std::vector<float> filled = value_;
  const glm::vec3 normal(0, 0, 1);
  const auto above = [&](uint32_t d) { return glm::dot(normal, grid_.direction(d)) > 0; };
  int predicted = 0;
  ForEachPredicted(
      grid_, above, [&](uint32_t d) { return stored_[d] != 0; },
      [&](uint32_t d, const std::array<uint32_t, 2>& ends, const std::array<float, 2>& share) {
        EXPECT_FALSE(stored_[d]);
        filled[d] = share[0] * filled[ends[0]] + share[1] * filled[ends[1]];
        ++predicted;
      });
  EXPECT_GT(predicted, 100);
  for (uint32_t t = 0; t < grid_.triangles().size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const uint32_t d = grid_.triangles()[t][i];
      if (!above(d)) continue;
      DirectionGrid::Location at{grid_.triangles()[t], {}, t};
      at.weight[i] = 1;
      ASSERT_NEAR(Read(at, normal), filled[d], 1e-5);
    }
}

INSTANTIATE_TEST_SUITE_P(Bases, NestedTest, testing::Values(0, 1, 2));

}  // namespace
}  // namespace glint
