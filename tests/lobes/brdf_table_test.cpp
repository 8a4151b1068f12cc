#include "common/lobes/brdf_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "common/base/rng.h"
#include "common/lobes/slice_fit.h"
#include "common/lobes/vmf.h"
#include "tests/lobes/chi_square.h"

namespace glint {
namespace {

struct Case {
  BrdfModel model;
  float shape;
  int lobes;
};

glm::vec3 AtCosine(float c, float phi = 0) {
  const float s = std::sqrt((1 - c) * (1 + c));
  return {s * std::cos(phi), s * std::sin(phi), c};
}

BrdfShape Fit(const Case& c) {
  return FitBrdfShape(c.model, c.shape, {.max_lobes = c.lobes, .tolerance = 0});
}

std::vector<Case> Cases() {
  return {{BrdfModel::kGgx, 0.1f, 3}, {BrdfModel::kGgx, 0.35f, 2},     {BrdfModel::kGgx, 0.5f, 4},
          {BrdfModel::kGgx, 1, 1},    {BrdfModel::kPhong, 32, 1},      {BrdfModel::kPhong, 512, 2},
          {BrdfModel::kPhong, 1, 2},  {BrdfModel::kBlinnPhong, 100, 3}};
}

SliceMixture ToMixture(const BrdfSlice& slice) {
  SliceMixture m;
  m.lobes = slice.lobes;
  for (int k = 0; k < slice.lobes; ++k) {
    const BrdfLobe& l = slice.lobe[k];
    m.lobe[k] = SliceMixture::Lobe{std::atan2(l.mu_x, l.mu_z), std::log(l.kappa),
                                   std::log((l.scale + l.bias) / l.above)};
  }
  return m;
}

// Albedo with Schlick's Fresnel term for F0 on a grid four times finer than the fit's.
double ExactAlbedo(BrdfModel model, float shape, float cos_o, double f0) {
  const SliceQuadrature q = MakeSliceQuadrature(model, shape, cos_o, 128);
  double sum = 0;
  for (size_t p = 0; p < q.value.size(); ++p) {
    const double fresnel = model == BrdfModel::kGgx ? f0 + (1 - f0) * q.schlick[p] : f0;
    sum += q.weight[p] * q.value[p] * fresnel;
  }
  return sum;
}

TEST(BrdfTableTest, NodesAreFinerAtTheHorizonAndEndAtTheNormal) {
  EXPECT_EQ(ElevationNode(0), kMinCosine);
  EXPECT_EQ(ElevationNode(kElevationNodes - 1), 1);
  for (int i = 2; i < kElevationNodes; ++i)
    EXPECT_GT(ElevationNode(i) - ElevationNode(i - 1), ElevationNode(i - 1) - ElevationNode(i - 2) - 1e-6f)
        << i;
}

TEST(BrdfTableTest, LookupGoesThroughTheNodes) {
  const BrdfShape shape = Fit({BrdfModel::kGgx, 0.35f, 3});
  for (int i = 0; i < kElevationNodes; ++i) {
    const BrdfSlice found = LookupSlice(shape, ElevationNode(i));
    for (int k = 0; k < shape.lobes; ++k) {
      const BrdfLobe &l = found.lobe[k], &node = shape.slices[i].lobe[k];
      EXPECT_NEAR(l.mu_x, node.mu_x, 1e-6f) << i;
      EXPECT_NEAR(l.mu_z, node.mu_z, 1e-6f) << i;
      EXPECT_NEAR(l.kappa, node.kappa, 1e-4f * node.kappa) << i;
      EXPECT_NEAR(l.scale, node.scale, 1e-4f) << i;
      EXPECT_NEAR(l.bias, node.bias, 1e-4f) << i;
    }
  }
}

TEST(BrdfTableTest, AlbedoIsKeptBetweenNodesToo) {
  for (const Case& c : Cases()) {
    const BrdfShape shape = Fit(c);
    for (const float cos_o : {1.0f, 0.93f, 0.7f, 0.41f, 0.2f, 0.07f, 0.01f})
      for (const float f0 : {0.04f, 1.0f}) {
        const BrdfSlice slice = LookupSlice(shape, cos_o);
        double sum = 0;
        for (int k = 0; k < slice.lobes; ++k) sum += slice.lobe[k].Weight(glm::vec3(f0)).x;
        const double exact = ExactAlbedo(c.model, c.shape, cos_o, f0);
        EXPECT_NEAR(sum / exact, 1, 0.01) << c.shape << " " << cos_o << " " << f0;
      }
  }
}

TEST(BrdfTableTest, LobesStayMatchedOverElevation) {
  for (const Case& c : Cases()) {
    const BrdfShape shape = Fit(c);
    for (int i = 0; i + 1 < kElevationNodes; ++i) {
      const double turn = std::acos(ElevationNode(i)) - std::acos(ElevationNode(i + 1));
      for (int k = 0; k < shape.lobes; ++k) {
        const BrdfLobe &a = shape.slices[i].lobe[k], &b = shape.slices[i + 1].lobe[k];
        const double way = std::atan2(a.mu_x, a.mu_z) + turn - std::atan2(b.mu_x, b.mu_z);
        EXPECT_LT(std::abs(way) * std::sqrt(std::min(a.kappa, b.kappa)), 3.5)
            << c.shape << " " << i << " " << k;
        EXPECT_LT(std::abs(std::log(a.kappa / b.kappa)), 2.2) << c.shape << " " << i << " " << k;
      }
      // What that is for: a slice between two nodes is nearly as good as the worse of the two.
      const float mid = (ElevationNode(i) + ElevationNode(i + 1)) / 2;
      if (i % 4 != 0) continue;
      const auto error = [&](float cos_o) {
        return RelativeL2(MakeSliceQuadrature(c.model, c.shape, cos_o), ToMixture(LookupSlice(shape, cos_o)));
      };
      EXPECT_LT(error(mid), std::max(error(ElevationNode(i)), error(ElevationNode(i + 1))) + 0.03)
          << c.shape << i;
    }
  }
}

TEST(BrdfTableTest, MoreLobesFitBetterAndTheErrorIsTheOneReported) {
  float last = 1;
  for (int lobes = 1; lobes <= 4; ++lobes) {
    const BrdfShape shape = Fit({BrdfModel::kGgx, 0.35f, lobes});
    EXPECT_EQ(shape.lobes, lobes);
    EXPECT_LT(shape.error.mean_l2, 0.85f * last);
    last = shape.error.mean_l2;
    double worst = 0;
    for (int i = 0; i < kElevationNodes; ++i)
      worst = std::max(worst, RelativeL2(MakeSliceQuadrature(BrdfModel::kGgx, 0.35f, ElevationNode(i), 64),
                                         ToMixture(shape.slices[i])));
    EXPECT_NEAR(shape.error.max_l2, worst, 0.02 * worst);
  }
  EXPECT_LT(last, 0.15f);
  EXPECT_LT(Fit({BrdfModel::kPhong, 128, 1}).error.mean_l2, 0.035f);
}

TEST(BrdfTableTest, TakesTheFewestLobesWithinTheTolerance) {
  EXPECT_EQ(FitBrdfShape(BrdfModel::kPhong, 512, {.max_lobes = 4, .tolerance = 0.05f}).lobes, 1);
  EXPECT_EQ(FitBrdfShape(BrdfModel::kGgx, 0.5f, {.max_lobes = 4, .tolerance = 0.25f}).lobes, 2);
  EXPECT_EQ(FitBrdfShape(BrdfModel::kGgx, 0.2f, {.max_lobes = 3, .tolerance = 0.01f}).lobes, 3);
}

TEST(BrdfTableTest, ExtremeShapesGiveFiniteLobes) {
  for (const Case& c :
       {Case{BrdfModel::kGgx, 0.0f, 3}, Case{BrdfModel::kGgx, 0.03f, 4}, Case{BrdfModel::kPhong, 1e5f, 3},
        Case{BrdfModel::kPhong, 1, 4}, Case{BrdfModel::kBlinnPhong, 1e5f, 3}}) {
    const BrdfShape shape = Fit(c);
    for (const BrdfSlice& slice : shape.slices)
      for (int k = 0; k < slice.lobes; ++k) {
        const BrdfLobe& l = slice.lobe[k];
        EXPECT_TRUE(std::isfinite(l.mu_x + l.mu_z + l.kappa + l.scale + l.bias)) << c.shape;
        EXPECT_NEAR(std::hypot(l.mu_x, l.mu_z), 1, 1e-6);
        EXPECT_GE(l.scale, 0);
        EXPECT_GE(l.bias, 0);
        EXPECT_LE(l.kappa, kMaxKappa * 1.0001f);
        EXPECT_GT(l.above, 0);
        EXPECT_LE(l.above, 1);
      }
    EXPECT_LT(shape.error.max_albedo, 1e-4f) << c.shape;
  }
}

TEST(BrdfTableTest, FitIsDeterministic) {
  const BrdfShape a = Fit({BrdfModel::kGgx, 0.25f, 3}), b = Fit({BrdfModel::kGgx, 0.25f, 3});
  for (int i = 0; i < kElevationNodes; ++i)
    for (int k = 0; k < a.lobes; ++k) {
      EXPECT_EQ(a.slices[i].lobe[k].kappa, b.slices[i].lobe[k].kappa);
      EXPECT_EQ(a.slices[i].lobe[k].mu_x, b.slices[i].lobe[k].mu_x);
      EXPECT_EQ(a.slices[i].lobe[k].bias, b.slices[i].lobe[k].bias);
    }
}

TEST(BrdfTableTest, PartAboveMatchesSamples) {
  for (const double theta : {0.0, -1.2, -1.5, -1.7})
    for (const float kappa : {0.3f, 5.0f, 200.0f}) {
      const Vmf lobe{{static_cast<float>(std::sin(theta)), 0, static_cast<float>(std::cos(theta))}, kappa};
      constexpr int kGrid = 256;
      CounterRng rng(2, 2);
      int above = 0;
      for (int i = 0; i < kGrid; ++i)
        for (int j = 0; j < kGrid; ++j)
          above += SampleVmf(lobe, (static_cast<float>(i) + rng.Uniform()) / kGrid,
                             (static_cast<float>(j) + rng.Uniform()) / kGrid)
                       .z > 0;
      EXPECT_NEAR(PartAbove(theta, kappa), above / static_cast<double>(kGrid * kGrid), 3e-3)
          << theta << " " << kappa;
    }
}

TEST(BrdfTableTest, DiffuseAlbedoMatchesQuadrature) {
  Brdf brdf{BrdfModel::kGgx, 0.5f, glm::vec3(0.04f), glm::vec3(0.8f)};
  for (const float cos_o : {1.0f, 0.77f, 0.33f, 0.05f, 0.001f}) {
    const glm::vec3 wo = AtCosine(cos_o);
    double sum = 0;
    constexpr int kGrid = 300;
    for (int i = 0; i < kGrid; ++i)
      for (int j = 0; j < kGrid; ++j) {
        const float z = (static_cast<float>(i) + 0.5f) / kGrid,
                    phi = 2 * kPi * (static_cast<float>(j) + 0.5f) / kGrid;
        const glm::vec3 wi = AtCosine(z, phi), h = glm::normalize(wo + wi);
        sum += z * (1 - std::pow(1 - glm::dot(wo, h), 5.0));
      }
    const double exact = 0.8 * 0.96 * sum * 2 / (kGrid * kGrid);
    EXPECT_NEAR(DiffuseAlbedo(brdf, cos_o).x, exact, 2e-3) << cos_o;
  }
  brdf.model = BrdfModel::kPhong;
  EXPECT_EQ(DiffuseAlbedo(brdf, 0.3f), brdf.diffuse);
}

// Mean weight of a sampler over stratified numbers: the reflected part of a white furnace.
template <class Sample>
double Furnace(const Sample& sample) {
  constexpr int kGrid = 96;
  CounterRng rng(9, 1);
  double sum = 0;
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j) {
      const float u = (static_cast<float>(i) + rng.Uniform()) / kGrid;
      sum += sample(rng.Uniform(), u, (static_cast<float>(j) + rng.Uniform()) / kGrid).weight.x;
    }
  return sum / (kGrid * kGrid);
}

TEST(BrdfTableTest, WhiteFurnaceAgreesWithTheTrueBrdf) {
  for (const Case& c : Cases()) {
    const BrdfShape shape = Fit(c);
    for (const float f0 : {1.0f, 0.04f}) {
      const Brdf brdf{c.model, c.shape, glm::vec3(f0), glm::vec3(f0 < 1 ? 0.6f : 0.0f)};
      for (const float cos_o : {0.98f, 0.6f, 0.25f, 0.06f}) {
        const glm::vec3 wo = AtCosine(cos_o, 2);
        const double exact =
            Furnace([&](float a, float u, float v) { return SampleBrdf(brdf, wo, a, u, v); });
        const double lobes =
            Furnace([&](float a, float u, float v) { return SampleLobes(brdf, shape, wo, a, u, v); });
        EXPECT_NEAR(lobes / exact, 1, 0.01)
            << static_cast<int>(c.model) << c.shape << " " << cos_o << " " << f0;
        if (c.model == BrdfModel::kGgx && f0 == 1) {
          EXPECT_LT(exact, 1 + 1e-6);
        }
      }
    }
  }
}

TEST(BrdfTableTest, SamplesFollowTheDensity) {
  for (const Case& c : Cases()) {
    const BrdfShape shape = Fit(c);
    const Brdf brdf{c.model, c.shape, glm::vec3(0.5f), glm::vec3(0.2f)};
    for (const float cos_o : {0.9f, 0.4f, 0.08f}) {
      const glm::vec3 wo = AtCosine(cos_o, 2.5f);
      CounterRng rng(33, 4);
      const auto sample = [&] {
        return SampleLobes(brdf, shape, wo, rng.Uniform(), rng.Uniform(), rng.Uniform()).wi;
      };
      const auto pdf = [&](const glm::vec3& wi) { return PdfLobes(brdf, shape, wo, wi); };
      EXPECT_GT(ChiSquareOfSphere({-wo.x, -wo.y, wo.z}, 2e5f, 20000, sample, pdf), 1e-4)
          << c.shape << " " << cos_o;
    }
  }
}

TEST(BrdfTableTest, SampleWeightIsValueOverDensity) {
  const BrdfShape shape = Fit({BrdfModel::kGgx, 0.3f, 3});
  const Brdf brdf{BrdfModel::kGgx, 0.3f, glm::vec3(0.3f, 0.6f, 0.9f), glm::vec3(0.2f)};
  CounterRng rng(34, 4);
  for (int i = 0; i < 500; ++i) {
    const glm::vec3 wo = AtCosine(rng.Uniform(), 6 * rng.Uniform());
    const BrdfSample s = SampleLobes(brdf, shape, wo, rng.Uniform(), rng.Uniform(), rng.Uniform());
    if (s.pdf == 0) continue;
    EXPECT_GT(s.wi.z, 0);
    EXPECT_NEAR(s.pdf, PdfLobes(brdf, shape, wo, s.wi), 1e-5f * s.pdf);
    const glm::vec3 value = EvaluateLobes(brdf, shape, wo, s.wi);
    EXPECT_NEAR(s.weight.z * s.pdf, value.z, 1e-4f * value.z);
  }
  EXPECT_EQ(EvaluateLobes(brdf, shape, AtCosine(0.4f), AtCosine(-0.1f)), glm::vec3(0));
}

}  // namespace
}  // namespace glint
