#include "common/lobes/slice_sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "common/lobes/horizon.h"

namespace glint {
namespace {

class SliceSamplerTest : public testing::TestWithParam<std::tuple<BrdfModel, float>> {};

void ExpectNear(const BrdfLobe& a, const BrdfLobe& b, float cos_o) {
  const float width = 1 / std::sqrt(std::max(b.kappa, 1.0f));
  EXPECT_NEAR(std::hypot(a.mu_x, a.mu_z), 1, 1e-6f);
  EXPECT_LT(std::hypot(a.mu_x - b.mu_x, a.mu_z - b.mu_z), (cos_o > 0.001f ? 1e-2f : 3e-2f) * width) << cos_o;
  EXPECT_NEAR(a.kappa / b.kappa, 1, 1e-2f) << cos_o;
  EXPECT_NEAR(a.scale, b.scale, 1e-3f) << cos_o;
  EXPECT_NEAR(a.bias, b.bias, 1e-3f) << cos_o;
}

TEST_P(SliceSamplerTest, AgreesWithTheFitBetweenItsNodesToo) {
  const auto [model, parameter] = GetParam();
  const BrdfShape shape = FitBrdfShape(model, parameter, {.max_lobes = 2});
  const SliceSampler sampler(shape);
  ASSERT_EQ(sampler.lobes(), shape.lobes);
  for (int i = 0; i <= 5000; ++i) {
    const float t = static_cast<float>(i) / 5000, cos_o = t * t;
    const BrdfSlice want = LookupSlice(shape, cos_o), fitted = sampler.Fitted(cos_o),
                    seen = sampler.Seen(cos_o);
    BrdfSlice weights;
    sampler.Weights(cos_o, &weights);
    ASSERT_EQ(fitted.lobes, want.lobes);
    for (int k = 0; k < want.lobes; ++k) {
      ExpectNear(fitted.lobe[k], want.lobe[k], cos_o);
      // AboveHorizon has a step where it begins; only there can the tabulated lobe differ from it.
      if (std::abs(want.lobe[k].above - 0.995f) > 0.01f)
        ExpectNear(seen.lobe[k], AboveHorizon(want.lobe[k]), cos_o);
      EXPECT_EQ(weights.lobe[k].scale, fitted.lobe[k].scale);
      EXPECT_EQ(weights.lobe[k].bias, fitted.lobe[k].bias);
    }
  }
}

TEST_P(SliceSamplerTest, ManyAtOnceAreThoseOneByOne) {
  const auto [model, parameter] = GetParam();
  const SliceSampler sampler(FitBrdfShape(model, parameter, {.max_lobes = 2}));
  std::vector<float> cos_o = {0, 1e-6f, 1};
  for (int i = 0; i < 1000; ++i) cos_o.push_back((static_cast<float>(i) + 0.5f) / 1000);
  for (int k = 0; k < sampler.lobes(); ++k) {
    LobeArrays fitted, seen;
    sampler.Lobes(cos_o, k, &fitted, &seen);
    const auto expect = [](const LobeArrays& many, size_t i, const BrdfLobe& one) {
      EXPECT_FLOAT_EQ(many.mu_x[i] + 2, one.mu_x + 2);
      EXPECT_FLOAT_EQ(many.mu_z[i] + 2, one.mu_z + 2);
      EXPECT_FLOAT_EQ(many.kappa[i], one.kappa);
    };
    for (size_t i = 0; i < cos_o.size(); ++i) {
      expect(fitted, i, sampler.Fitted(cos_o[i]).lobe[k]);
      expect(seen, i, sampler.SeenLobe(cos_o[i], k));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, SliceSamplerTest,
                         testing::Values(std::tuple{BrdfModel::kPhong, 512.0f},
                                         std::tuple{BrdfModel::kPhong, 8.0f},
                                         std::tuple{BrdfModel::kGgx, 0.15f},
                                         std::tuple{BrdfModel::kGgx, 0.6f}));

}  // namespace
}  // namespace glint
