#include "common/lobes/horizon.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "common/lobes/vmf.h"

namespace glint {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// What a vMF leaves above z = 0.
struct Cut {
  double weight = 0;   ///< of 1
  glm::dvec3 mean{0};  ///< unnormalised first moment over weight
};

/// By summing the lobe, in rings around its axis out to where nothing of it is left.
Cut Integrate(const Vmf& lobe) {
  constexpr int kRings = 600, kSteps = 720;
  const glm::dvec3 mu(lobe.mu), y(0, 1, 0), x = glm::normalize(glm::cross(y, mu));
  const double kappa = lobe.kappa, reach = std::min(2.0, 18 / kappa);  // of 1 - cosine
  Cut cut;
  double all = 0;
  for (int i = 0; i < kRings; ++i) {
    const double c = 1 - reach * (i + 0.5) / kRings, s = std::sqrt(1 - c * c);
    const double weight = std::exp(kappa * (c - 1));
    for (int j = 0; j < kSteps; ++j) {
      const double phi = 2 * kPi * (j + 0.5) / kSteps;
      const glm::dvec3 d = c * mu + s * (std::cos(phi) * x + std::sin(phi) * y);
      all += weight;
      if (d.z <= 0) continue;
      cut.weight += weight;
      cut.mean += weight * d;
    }
  }
  cut.mean /= cut.weight;
  cut.weight /= all;
  return cut;
}

BrdfLobe MakeLobe(float kappa, double elevation) {
  BrdfLobe lobe;
  lobe.mu_x = static_cast<float>(-std::cos(elevation));
  lobe.mu_z = static_cast<float>(std::sin(elevation));
  lobe.kappa = kappa;
  lobe.scale = 0.7f;
  lobe.bias = 0.1f;
  lobe.above = static_cast<float>(Integrate({{lobe.mu_x, 0, lobe.mu_z}, kappa}).weight);
  return lobe;
}

// Kappa, and the elevation in standard deviations above the horizon.
class AboveHorizonTest : public testing::TestWithParam<std::tuple<float, double>> {};

TEST_P(AboveHorizonTest, HasTheMomentsOfThePartAbove) {
  const auto [kappa, sigmas] = GetParam();
  const double sigma = 1 / std::sqrt(kappa);
  const BrdfLobe lobe = MakeLobe(kappa, sigmas * sigma), seen = AboveHorizon(lobe);
  const Cut truth = Integrate({{lobe.mu_x, 0, lobe.mu_z}, kappa});
  const double length = glm::length(truth.mean);
  const double kappa_truth = KappaFromDelta(static_cast<float>(1 - length));
  const double off = glm::distance(glm::dvec3(seen.mu_x, 0, seen.mu_z), truth.mean / length) / sigma;
  EXPECT_LT(off, 0.12) << "in standard deviations";
  EXPECT_NEAR(seen.kappa / kappa_truth, 1, 0.06);
}

INSTANTIATE_TEST_SUITE_P(Sharp, AboveHorizonTest,
                         testing::Combine(testing::Values(30.0f, 200.0f, 5000.0f),
                                          testing::Values(-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0)));
// So broad a lobe is no normal distribution on a plane any more; it still is where most of it is above.
INSTANTIATE_TEST_SUITE_P(Broad, AboveHorizonTest,
                         testing::Combine(testing::Values(8.0f),
                                          testing::Values(-0.5, 0.0, 0.5, 1.0, 2.0, 3.0)));

TEST(AboveHorizonKeepsTest, WeightAndPlane) {
  for (const double elevation : {-0.3, 0.0, 0.2}) {
    const BrdfLobe lobe = MakeLobe(30, elevation), seen = AboveHorizon(lobe);
    EXPECT_EQ(seen.scale, lobe.scale);
    EXPECT_EQ(seen.bias, lobe.bias);
    EXPECT_NEAR(seen.mu_x * seen.mu_x + seen.mu_z * seen.mu_z, 1, 1e-5);
    EXPECT_GT(seen.mu_z, lobe.mu_z);
    EXPECT_LT(seen.mu_x, 0);
    EXPECT_GE(seen.kappa, lobe.kappa);
    // The same lobe on the other side of the normal.
    BrdfLobe mirrored = lobe;
    mirrored.mu_x = -mirrored.mu_x;
    EXPECT_FLOAT_EQ(AboveHorizon(mirrored).mu_x, -seen.mu_x);
    EXPECT_FLOAT_EQ(AboveHorizon(mirrored).mu_z, seen.mu_z);
  }
}

TEST(AboveHorizonKeepsTest, LobesThatHardlyReachTheHorizon) {
  const BrdfLobe lobe = MakeLobe(100, 0.6);
  ASSERT_GT(lobe.above, 0.995f);
  const BrdfLobe seen = AboveHorizon(lobe);
  EXPECT_EQ(seen.mu_x, lobe.mu_x);
  EXPECT_EQ(seen.mu_z, lobe.mu_z);
  EXPECT_EQ(seen.kappa, lobe.kappa);
}

TEST(AboveHorizonKeepsTest, FiniteForEveryLobe) {
  for (const float kappa : {0.0f, 1e-6f, 0.5f, 1.0f, 10.0f, kMaxKappa})
    for (int degree = -90; degree <= 90; degree += 5)
      for (const float above : {0.0f, 0.3f, 1.0f}) {
        BrdfLobe lobe;
        lobe.mu_x = -std::cos(glm::radians(static_cast<float>(degree)));
        lobe.mu_z = std::sin(glm::radians(static_cast<float>(degree)));
        lobe.kappa = kappa;
        lobe.above = above;
        const BrdfLobe seen = AboveHorizon(lobe);
        EXPECT_NEAR(seen.mu_x * seen.mu_x + seen.mu_z * seen.mu_z, 1, 1e-4) << kappa << " " << degree;
        EXPECT_TRUE(seen.kappa >= 0 && seen.kappa <= 2 * kMaxKappa) << kappa << " " << degree;
      }
}

}  // namespace
}  // namespace glint
