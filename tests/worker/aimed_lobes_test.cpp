#include "worker/aimed_lobes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "worker/slice_lobes.h"

namespace glint {
namespace {

constexpr float kSharpest = 60;

class AimedLobesTest : public testing::Test {
 protected:
  void Aim(uint32_t first, uint32_t columns) {
    aimed_.Aim(grid_, first, columns, sampler_, frame_, kSharpest);
  }

  const DirectionGrid grid_{3};
  const SliceSampler sampler_{FitBrdfShape(BrdfModel::kGgx, 0.3f, {.max_lobes = 2})};
  const Frame frame_ = Frame::FromNormal(glm::normalize(glm::vec3(0.3f, -0.8f, -0.4f)));
  AimedLobes aimed_;
};

TEST_F(AimedLobesTest, HasTheDirectionsAboveTheSideInOrder) {
  Aim(100, 400);
  std::vector<uint16_t> above;
  for (uint16_t c = 100; c < 500; ++c)
    if (glm::dot(frame_.n, grid_.direction(c)) > 0) above.push_back(c);
  ASSERT_EQ(aimed_.size(), above.size());
  for (size_t i = 0; i < above.size(); ++i) EXPECT_EQ(aimed_.column(i), above[i]);
}

TEST_F(AimedLobesTest, AgreesWithSlicesOneByOne) {
  Aim(0, grid_.size());
  ASSERT_EQ(aimed_.lobes(), sampler_.lobes());
  ASSERT_GT(aimed_.size(), 250u);
  for (size_t i = 0; i < aimed_.size(); ++i) {
    const UnoccludedSlice slice(sampler_, frame_.n, grid_.direction(aimed_.column(i)));
    for (int k = 0; k < aimed_.lobes(); ++k) {
      const LobeWeight weight = aimed_.weight(i, k);
      const glm::vec3 mu = frame_.ToLocal(slice.Direction(slice.lobes.lobe[k]));
      EXPECT_LT(glm::distance(glm::vec3(weight.x, weight.y, weight.z), mu), 1e-5f);
      const float fitted = slice.lobes.lobe[k].kappa, kappa = std::min(fitted, kSharpest);
      EXPECT_NEAR(weight.kappa_log2e, kappa / std::log(2.0f), 1e-4f * kappa);
      EXPECT_NEAR(aimed_.resolution(i, k), kappa / fitted, 1e-5f);
      const BrdfLobe seen = slice.Seen(sampler_, k);
      EXPECT_LT(glm::distance(frame_.ToWorld(aimed_.seen_mu(i, k)), slice.Direction(seen)), 1e-5f);
      EXPECT_NEAR(aimed_.seen_kappa(i, k), seen.kappa, 1e-4f * seen.kappa);
    }
  }
}

TEST_F(AimedLobesTest, WeightsAreSmallOutsideTheCone) {
  Aim(0, grid_.size());
  for (size_t i = 0; i < aimed_.size(); ++i) {
    const QueryCone cone = aimed_.cone(i, 0);
    EXPECT_NEAR(cone.cos_radius * cone.cos_radius + cone.sin_radius * cone.sin_radius, 1, 1e-5f);
    const float at_edge = std::exp2(aimed_.weight(i, 0).kappa_log2e * (cone.cos_radius - 1));
    EXPECT_TRUE(at_edge < 3e-3f || cone.cos_radius == -1) << at_edge;
  }
}

TEST_F(AimedLobesTest, NormalIncidenceIsDefined) {
  const uint32_t column = 17;
  AimedLobes aimed;
  aimed.Aim(grid_, column, 1, sampler_, Frame::FromNormal(grid_.direction(column)), kSharpest);
  ASSERT_EQ(aimed.size(), 1u);
  EXPECT_NEAR(glm::length(aimed.seen_mu(0, 0)), 1, 1e-6f);
  EXPECT_GT(aimed.seen_mu(0, 0).z, 0.99f);
}

}  // namespace
}  // namespace glint
