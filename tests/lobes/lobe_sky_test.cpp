#include "common/lobes/lobe_sky.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"

namespace glint {
namespace {

/// integral of radiance x weight over the sphere, midpoints of 512 x 1024 cells of equal solid angle.
template <class Weight>
double Integrate(const LobeSky& sky, const Weight& weight) {
  constexpr int kRows = 512, kColumns = 1024;
  double sum = 0;
  for (int i = 0; i < kRows; ++i) {
    const float z = -1 + 2 * (static_cast<float>(i) + 0.5f) / kRows, r = std::sqrt(1 - z * z);
    for (int j = 0; j < kColumns; ++j) {
      const float phi = 2 * kPi * (static_cast<float>(j) + 0.5f) / kColumns;
      const glm::vec3 d(r * std::cos(phi), r * std::sin(phi), z);
      sum += static_cast<double>(sky.Radiance(d)) * weight(d);
    }
  }
  return sum * 4 * kPi / (kRows * kColumns);
}

class LobeSkyTest : public testing::TestWithParam<uint32_t> {
 protected:
  LobeSkyTest() : rng_(1, GetParam()), sky_(&rng_) {}
  CounterRng rng_;
  LobeSky sky_;
};

TEST_P(LobeSkyTest, MeanRadianceIsOne) {
  EXPECT_NEAR(Integrate(sky_, [](const glm::vec3&) { return 1 / (4 * kPi); }), 1, 1e-3);
}

TEST_P(LobeSkyTest, FilteredIsTheIntegral) {
  for (const float kappa : {0.0f, 2.0f, 60.0f, 400.0f}) {
    const Vmf lobe{glm::normalize(glm::vec3(rng_.Uniform() - 0.5f, rng_.Uniform(), rng_.Uniform() - 0.5f)),
                   kappa};
    const double expected = Integrate(sky_, [&](const glm::vec3& d) { return VmfPdf(lobe, d); });
    EXPECT_NEAR(sky_.Filtered(lobe), expected, 2e-3 * expected) << "kappa " << kappa;
  }
}

TEST_P(LobeSkyTest, CosineAverageIsTheIntegral) {
  for (int i = 0; i < 4; ++i) {
    const glm::vec3 n =
        glm::normalize(glm::vec3(rng_.Uniform() - 0.5f, rng_.Uniform() - 0.5f, rng_.Uniform() - 0.5f));
    const double expected =
        Integrate(sky_, [&](const glm::vec3& d) { return std::max(0.0f, glm::dot(n, d)) / kPi; });
    EXPECT_NEAR(sky_.CosineAverage(n), expected, 0.01);
  }
}

INSTANTIATE_TEST_SUITE_P(Skies, LobeSkyTest, testing::Values(0u, 1u, 2u));

}  // namespace
}  // namespace glint
