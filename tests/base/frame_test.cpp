#include "common/base/frame.h"

#include <gtest/gtest.h>

#include "common/base/rng.h"

namespace glint {
namespace {

void ExpectOrthonormal(const glm::vec3& n) {
  const Frame frame = Frame::FromNormal(n);
  constexpr float kTolerance = 2e-6f;
  EXPECT_NEAR(glm::dot(frame.t, frame.t), 1, kTolerance);
  EXPECT_NEAR(glm::dot(frame.b, frame.b), 1, kTolerance);
  EXPECT_NEAR(glm::dot(frame.t, frame.b), 0, kTolerance);
  EXPECT_NEAR(glm::dot(frame.t, n), 0, kTolerance);
  EXPECT_NEAR(glm::dot(frame.b, n), 0, kTolerance);
  EXPECT_NEAR(glm::length(glm::cross(frame.t, frame.b) - n), 0, kTolerance);
  const glm::vec3 v(0.3f, -0.5f, 0.7f);
  EXPECT_NEAR(glm::length(frame.ToWorld(frame.ToLocal(v)) - v), 0, kTolerance);
}

TEST(FrameTest, IsRightHandedAndOrthonormalEverywhere) {
  for (const float s : {-1.0f, 1.0f}) {
    ExpectOrthonormal({s, 0, 0});
    ExpectOrthonormal({0, s, 0});
    ExpectOrthonormal({0, 0, s});
    ExpectOrthonormal(glm::normalize(glm::vec3(1e-4f, -1e-5f, s)));
    ExpectOrthonormal({1, 0, 0 * s});
  }
  CounterRng rng(1, 0);
  for (int i = 0; i < 1000; ++i) {
    const glm::vec3 v(rng.Uniform() - 0.5f, rng.Uniform() - 0.5f, rng.Uniform() - 0.5f);
    ExpectOrthonormal(glm::normalize(v));
  }
}

TEST(LuminanceTest, OfWhiteIsOne) { EXPECT_NEAR(Luminance(glm::vec3(1)), 1, 1e-6f); }

}  // namespace
}  // namespace glint
