#include "common/base/bend_normal.h"

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

float MirrorHeight(const glm::vec3& face, const glm::vec3& wo, const glm::vec3& n) {
  return glm::dot(2 * glm::dot(n, wo) * n - wo, face);
}

TEST(BendNormalTest, LeavesNormalsAloneWhoseMirrorDirectionIsAbove) {
  const glm::vec3 face{0, 0, 1}, wo = glm::normalize(glm::vec3{1, 0, 1});
  const glm::vec3 normal = glm::normalize(glm::vec3{0.2f, 0.1f, 1});
  EXPECT_EQ(BendNormal(face, wo, normal), normal);
}

TEST(BendNormalTest, BendsInThePlaneOfFaceAndNormalJustFarEnough) {
  CounterRng rng(5, 0);
  int bent = 0;
  for (int i = 0; i < 20000; ++i) {
    const glm::vec3 face = RandomDirection(&rng), normal = RandomDirection(&rng);
    glm::vec3 wo = RandomDirection(&rng);
    if (glm::dot(wo, face) < 0) wo = -wo;
    if (glm::dot(wo, face) < 1e-3f) continue;
    const float least = std::min(0.9f * glm::dot(face, wo), 0.01f);
    const glm::vec3 result = BendNormal(face, wo, normal);
    EXPECT_NEAR(glm::length(result), 1, 1e-5f);
    EXPECT_GT(glm::dot(result, wo), 0);
    EXPECT_GE(MirrorHeight(face, wo, result), least - 2e-5f);
    if (result == normal) continue;
    ++bent;
    EXPECT_NEAR(MirrorHeight(face, wo, result), least, 2e-5f);
    EXPECT_NEAR(glm::dot(result, glm::cross(face, normal)), 0, 1e-5f);
    EXPECT_GE(glm::dot(result, face), glm::dot(normal, face) - 1e-5f);  // towards the face's normal
  }
  EXPECT_GT(bent, 1000);
}

TEST(BendNormalTest, OppositeNormalBecomesTheFaces) {
  const glm::vec3 face{0, 0, 1}, wo = glm::normalize(glm::vec3{1, 0, 0.5f});
  EXPECT_EQ(BendNormal(face, wo, -face), face);
}

}  // namespace
}  // namespace glint
