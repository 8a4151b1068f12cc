#include "common/lobes/brdf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "common/base/rng.h"
#include "tests/lobes/chi_square.h"

namespace glint {
namespace {

glm::vec3 AtCosine(float c, float phi = 0) {
  const float s = std::sqrt((1 - c) * (1 + c));
  return {s * std::cos(phi), s * std::sin(phi), c};
}

Brdf Ggx(float roughness, float f0, float diffuse = 0) {
  return {BrdfModel::kGgx, roughness, glm::vec3(f0), glm::vec3(diffuse)};
}
Brdf Phong(float n) { return {BrdfModel::kPhong, n, glm::vec3(1), glm::vec3(0)}; }
Brdf BlinnPhong(float n) { return {BrdfModel::kBlinnPhong, n, glm::vec3(1), glm::vec3(0)}; }

std::vector<Brdf> Examples() {
  return {Ggx(0.1f, 1),       Ggx(0.3f, 0.04f, 0.7f),
          Ggx(1, 0.5f, 0.2f), Phong(1),
          Phong(40),          BlinnPhong(1),
          BlinnPhong(200),    {BrdfModel::kPhong, 20, glm::vec3(0.3f), glm::vec3(0.5f)}};
}

// Integral over the hemisphere of f cos on a grid of cos_i (squared spacing to the horizon) and azimuth.
double Albedo(const Brdf& brdf, const glm::vec3& wo, int rings = 1000, int sectors = 400) {
  double sum = 0;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sectors; ++j) {
      const float z = (static_cast<float>(i) + 0.5f) / static_cast<float>(rings);
      const float phi = 2 * kPi * (static_cast<float>(j) + 0.5f) / static_cast<float>(sectors);
      sum += EvaluateCosine(brdf, wo, AtCosine(z, phi)).y;
    }
  return sum * 2 * kPi / (static_cast<double>(rings) * sectors);
}

// Mean weight of stratified samples: the albedo by the sampler.
double SampledAlbedo(const Brdf& brdf, const glm::vec3& wo) {
  constexpr int kGrid = 128;
  CounterRng rng(5, 6);
  double sum = 0;
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j) {
      const float u = (static_cast<float>(i) + rng.Uniform()) / kGrid;
      const float v = (static_cast<float>(j) + rng.Uniform()) / kGrid;
      sum += SampleBrdf(brdf, wo, rng.Uniform(), u, v).weight.y;
    }
  return sum / (kGrid * kGrid);
}

TEST(BrdfTest, IsReciprocal) {
  CounterRng rng(1, 1);
  for (const Brdf& brdf : Examples())
    for (int i = 0; i < 100; ++i) {
      const glm::vec3 a = AtCosine(rng.Uniform(), 6 * rng.Uniform()),
                      b = AtCosine(rng.Uniform(), 6 * rng.Uniform());
      const float forth = EvaluateCosine(brdf, a, b).x / b.z, back = EvaluateCosine(brdf, b, a).x / a.z;
      EXPECT_NEAR(forth, back, 2e-3f * forth + 1e-12f) << static_cast<int>(brdf.model) << " " << brdf.shape;
    }
}

TEST(BrdfTest, PhongModelsReflectAllAtNormalIncidence) {
  for (const float n : {1.0f, 8.0f, 60.0f}) {
    EXPECT_NEAR(Albedo(Phong(n), {0, 0, 1}), 1, 1e-3) << n;
    EXPECT_NEAR(Albedo(BlinnPhong(n), {0, 0, 1}), 1, 1e-3) << n;
  }
}

TEST(BrdfTest, PhongLosesHalfItsLobeAtTheHorizon) {
  // At grazing incidence the lobe is cut in half and weighted with cos_i:
  // (n+2)/(2 pi) * integral over the half lobe of cos^n * cos_i; cos_i = sin(theta) cos(phi) about the mirror
  // direction.
  for (const float n : {8.0f, 60.0f}) {
    const double moment =
        std::sqrt(static_cast<double>(kPi)) / 4 *
        std::exp(std::lgamma((n + 1) / 2.0) - std::lgamma((n + 4) / 2.0));  // of cos^n sin^2
    EXPECT_NEAR(Albedo(Phong(n), AtCosine(1e-4f)), (n + 2) / kPi * moment, 1e-3) << n;
  }
}

TEST(BrdfTest, RoughestGgxHasAClosedAlbedo) {
  // alpha = 1: D = 1/pi, f = 1 / (pi (1 + cos_o)(1 + cos_i)).
  for (const float c : {1.0f, 0.5f, 0.05f})
    EXPECT_NEAR(Albedo(Ggx(1, 1), AtCosine(c)), 2 * (1 - std::log(2.0)) / (1 + c), 1e-4) << c;
}

TEST(BrdfTest, EnergyIsNotCreated) {
  for (const Brdf& brdf : {Ggx(0.01f, 1), Ggx(0.1f, 1), Ggx(0.5f, 1), Phong(10), Phong(1e4f)})
    for (const float c : {1.0f, 0.6f, 0.2f, 0.02f}) {
      const double albedo = SampledAlbedo(brdf, AtCosine(c, 1));
      EXPECT_LE(albedo, 1 + 2e-3) << brdf.shape << " " << c;
      EXPECT_GT(albedo, brdf.model == BrdfModel::kGgx ? 0.2 : 0.01) << brdf.shape << " " << c;
    }
  EXPECT_NEAR(SampledAlbedo(Ggx(0.01f, 1), AtCosine(0.7f)), 1, 1e-3);
}

TEST(BrdfTest, FresnelHasItsLimits) {
  const glm::vec3 n(0, 0, 1);
  const Brdf none = Ggx(0.3f, 0);
  const float full = EvaluateCosine(Ggx(0.3f, 1), n, n).x;
  EXPECT_EQ(EvaluateCosine(none, n, n).x, 0);
  EXPECT_NEAR(EvaluateCosine(Ggx(0.3f, 0.04f), n, n).x, 0.04f * full, 1e-6f * full);
  // Both at grazing: v.h is small and even F0 = 0 reflects all.
  const glm::vec3 a = AtCosine(0.01f), b = AtCosine(0.01f, kPi);
  EXPECT_NEAR(EvaluateCosine(none, a, b).x / EvaluateCosine(Ggx(0.3f, 1), a, b).x, std::pow(0.99f, 5.0f),
              1e-4);
  // What the coat reflects does not reach the diffuse base.
  EXPECT_NEAR(EvaluateCosine(Ggx(0.3f, 1, 0.8f), n, n).x, full, 1e-6f * full);
}

TEST(BrdfTest, NothingGoesThroughTheSurface) {
  for (const Brdf& brdf : Examples()) {
    EXPECT_EQ(EvaluateCosine(brdf, AtCosine(0.5f), AtCosine(-0.5f)), glm::vec3(0));
    EXPECT_EQ(EvaluateCosine(brdf, AtCosine(-0.5f), AtCosine(0.5f)), glm::vec3(0));
    EXPECT_EQ(PdfBrdf(brdf, AtCosine(0.5f), AtCosine(-0.1f)), 0);
    EXPECT_EQ(SampleBrdf(brdf, AtCosine(-0.5f), 0.1f, 0.2f, 0.3f).pdf, 0);
  }
}

TEST(BrdfTest, SamplesFollowTheDensity) {
  for (const Brdf& brdf : Examples())
    for (const float c : {0.95f, 0.4f, 0.08f}) {
      const glm::vec3 wo = AtCosine(c, 0.7f);
      CounterRng rng(21, 3);
      const auto sample = [&] {
        return SampleBrdf(brdf, wo, rng.Uniform(), rng.Uniform(), rng.Uniform()).wi;
      };
      const auto pdf = [&](const glm::vec3& wi) { return PdfBrdf(brdf, wo, wi); };
      const float kappa = brdf.model == BrdfModel::kGgx ? 0.5f / std::pow(brdf.shape, 4.0f) : brdf.shape / 2;
      EXPECT_GT(ChiSquareOfSphere({-wo.x, -wo.y, wo.z}, kappa / (c * c), 20000, sample, pdf), 1e-4)
          << static_cast<int>(brdf.model) << " " << brdf.shape << " " << c;
    }
}

TEST(BrdfTest, SampleWeightIsValueOverDensity) {
  CounterRng rng(22, 3);
  for (const Brdf& brdf : Examples())
    for (int i = 0; i < 200; ++i) {
      const glm::vec3 wo = AtCosine(rng.Uniform(), 6 * rng.Uniform());
      const BrdfSample s = SampleBrdf(brdf, wo, rng.Uniform(), rng.Uniform(), rng.Uniform());
      if (s.pdf == 0) continue;
      EXPECT_NEAR(s.pdf, PdfBrdf(brdf, wo, s.wi), 1e-5f * s.pdf);
      const glm::vec3 value = EvaluateCosine(brdf, wo, s.wi);
      EXPECT_NEAR(s.weight.x * s.pdf, value.x, 1e-4f * value.x + 1e-12f);
    }
}

TEST(BrdfTest, SamplerAndQuadratureAgreeOnTheAlbedo) {
  for (const Brdf& brdf : {Ggx(0.4f, 0.04f, 0.7f), Ggx(0.6f, 0.9f), Phong(20), BlinnPhong(60)})
    for (const float c : {0.9f, 0.3f}) {
      const glm::vec3 wo = AtCosine(c, 0.4f);
      const double exact = Albedo(brdf, wo);
      EXPECT_NEAR(SampledAlbedo(brdf, wo) / exact, 1, 0.01) << brdf.shape << " " << c;
    }
}

}  // namespace
}  // namespace glint
