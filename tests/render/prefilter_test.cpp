#include "common/render/prefilter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "common/base/frame.h"
#include "common/base/rng.h"
#include "tests/render/render_test_support.h"

namespace glint {
namespace {

glm::vec3 RandomDirection(CounterRng& rng) {
  const float y = 2 * rng.Uniform() - 1, phi = 2 * kPi * rng.Uniform(), r = std::sqrt(1 - y * y);
  return {r * std::cos(phi), y, r * std::sin(phi)};
}

/// Integral of the bilinear radiance against a kernel of the direction's cosine to `axis`, sampled `sub` x
/// `sub` times a texel, in double. Rows further than `reach` radians in latitude are left out. Divides by the
/// kernel's own integral if `normalized`.
template <class Kernel>
glm::dvec3 Integrate(const Environment& environment, const glm::vec3& axis, int sub, double reach,
                     bool normalized, const Kernel& kernel) {
  const int w = environment.width() * sub, h = environment.height() * sub;
  const double latitude = std::asin(std::clamp(axis.y, -1.0f, 1.0f));
  glm::dvec3 sum(0);
  double weights = 0;
  for (int y = 0; y < h; ++y) {
    const double row = (0.5 - (y + 0.5) / h) * kPi;
    if (std::abs(row - latitude) > reach) continue;
    const double solid_angle = std::cos(row) * 2 * kPi / w * kPi / h;
    for (int x = 0; x < w; ++x) {
      const glm::vec3 d = Environment::Direction((float(x) + 0.5f) / float(w), (float(y) + 0.5f) / float(h));
      // 1 - cosine by the chord, which keeps its digits for near directions.
      const glm::vec3 chord = d - axis;
      const double k = kernel(0.5 * glm::dot(chord, chord)) * solid_angle;
      if (k <= 0) continue;
      sum += k * glm::dvec3(environment.Radiance(d));
      weights += k;
    }
  }
  return normalized ? sum / weights : sum;
}

glm::dvec3 BruteForce(const Environment& environment, const glm::vec3& mu, double kappa) {
  // Sub-samples less than half the lobe's standard deviation apart; one a texel would miss the bilinear
  // filter's width.
  const double texel = kPi / environment.height();
  const int sub =
      std::max(environment.width() < 1024 ? 2 : 1, static_cast<int>(std::ceil(2 * texel * std::sqrt(kappa))));
  return Integrate(environment, mu, sub, kappa > 32 ? std::sqrt(36 / kappa) : 4, true,
                   [&](double one_minus_cosine) { return std::exp(-kappa * one_minus_cosine); });
}

glm::vec3 Brightest(const Environment& environment) {
  size_t best = 0;
  for (size_t i = 0; i < environment.texels().size(); ++i)
    if (Luminance(environment.texels()[i]) > Luminance(environment.texels()[best])) best = i;
  const size_t w = static_cast<size_t>(environment.width());
  return Environment::Direction((float(best % w) + 0.5f) / float(w),
                                (float(best / w) + 0.5f) / float(environment.height()));
}

/// Relative root mean square error of Filtered over random directions, some of them within the lobe's width
/// of the brightest texel and some at the poles.
double RelativeError(const Environment& environment, const PrefilteredEnvironment& prefiltered, float kappa,
                     int directions) {
  CounterRng rng(7, static_cast<uint32_t>(kappa));
  const glm::vec3 sun = Brightest(environment);
  double error = 0, scale = 0;
  for (int i = 0; i < directions; ++i) {
    glm::vec3 mu = RandomDirection(rng);
    if (i % 3 == 0) mu = glm::normalize(sun + mu * (rng.Uniform() / std::sqrt(kappa)));
    if (i % 6 == 1) mu = glm::normalize(glm::vec3(0.02f * mu.x, mu.y > 0 ? 1 : -1, 0.02f * mu.z));
    const glm::dvec3 truth = BruteForce(environment, mu, kappa);
    const glm::dvec3 difference = glm::dvec3(prefiltered.Filtered(mu, kappa)) - truth;
    error += glm::dot(difference, difference);
    scale += glm::dot(truth, truth);
  }
  return std::sqrt(error / scale);
}

TEST(PrefilterTest, UniformLightStaysUniform) {
  const PrefilteredEnvironment prefiltered(Environment::Procedural("uniform", 256).value());
  CounterRng rng(1, 3);
  for (int i = 0; i < 500; ++i) {
    const glm::vec3 d = RandomDirection(rng);
    for (const float kappa : {0.0f, 0.1f, 1.0f, 30.0f, 1000.0f, 1e4f, 1e6f})
      EXPECT_NEAR(prefiltered.Filtered(d, kappa).y, 1, 1e-4f) << kappa;
    EXPECT_NEAR(prefiltered.CosineAverage(d).x, 1, 2e-3f);
  }
}

TEST(PrefilterTest, AgreesWithBruteForceOnAndBetweenLevels) {
  const Environment environment = Environment::Procedural("sunset", 256).value();
  const PrefilteredEnvironment prefiltered(environment);
  // On the ladder only tabulation errs; the worst place between two levels is their geometric mean.
  for (const float kappa : {1.0f, 16.0f, 256.0f})
    EXPECT_LT(RelativeError(environment, prefiltered, kappa, 12), 0.015) << kappa;
  // Here the lobe's standard deviation is 1.3 of the map's texels, which are then the grid.
  EXPECT_LT(RelativeError(environment, prefiltered, 1024.0f, 12), 0.04);
  for (const float kappa : {0.7f, 5.7f, 90.0f, 724.0f})
    EXPECT_LT(RelativeError(environment, prefiltered, kappa, 12), 0.03) << kappa;
}

TEST(PrefilterTest, AgreesWithBruteForceOnACapturedSunset) {
  const auto path = test::SharedData("env/venice_sunset_1k.hdr");
  if (!path) return;
  const Environment environment = Environment::Load(*path).value();
  const PrefilteredEnvironment prefiltered(environment);
  // Its sun is three texels wide and 2000 times brighter than the sky: nothing is harder to tabulate.
  for (const float kappa : {32.0f, 2048.0f, 8192.0f})
    EXPECT_LT(RelativeError(environment, prefiltered, kappa, 6), 0.025) << kappa;
  for (const float kappa : {90.0f, 1448.0f, 11585.0f})
    EXPECT_LT(RelativeError(environment, prefiltered, kappa, 6), 0.04) << kappa;
  EXPECT_LT(RelativeError(environment, prefiltered, 60000.0f, 6), 0.15);
}

TEST(PrefilterTest, ContinuousInKappa) {
  const Environment environment = Environment::Procedural("studio", 256).value();
  const PrefilteredEnvironment prefiltered(environment);
  CounterRng rng(2, 3);
  for (int i = 0; i < 50; ++i) {
    const glm::vec3 d = RandomDirection(rng);
    for (float kappa = 0.01f; kappa < 1e6f; kappa *= 2) {
      // Both sides of every place where the formula changes.
      for (const float edge : {std::exp2(std::round(std::log2(kappa))), kappa}) {
        const float a = prefiltered.Filtered(d, edge * 0.9999f).y,
                    b = prefiltered.Filtered(d, edge * 1.0001f).y;
        EXPECT_NEAR(a, b, 0.002f * (a + b) + 1e-4f) << edge;
      }
    }
    const glm::vec3 plain = environment.Radiance(d), sharp = prefiltered.Filtered(d, 1e9f);
    EXPECT_LT(glm::length(plain - sharp), 1e-3f * (1 + glm::length(plain)));
  }
}

TEST(PrefilterTest, CosineAverageAgreesWithBruteForce) {
  std::vector<Environment> environments;
  environments.push_back(Environment::Procedural("studio", 256).value());
  environments.push_back(Environment::Procedural("sunset", 256).value());
  if (const auto path = test::SharedData("env/venice_sunset_1k.hdr"))
    environments.push_back(Environment::Load(*path).value());
  for (const Environment& environment : environments) {
    const PrefilteredEnvironment prefiltered(environment);
    CounterRng rng(3, 3);
    double largest = 0;
    std::vector<double> errors;
    for (int i = 0; i < 8; ++i) {
      const glm::vec3 n = RandomDirection(rng);
      const glm::dvec3 truth =
          Integrate(environment, n, environment.width() < 1024 ? 2 : 1, 4, false,
                    [](double one_minus_cosine) { return std::max(0.0, 1 - one_minus_cosine) / kPi; });
      const glm::dvec3 got(prefiltered.CosineAverage(n));
      largest = std::max({largest, truth.x, truth.y, truth.z});
      for (int c = 0; c < 3; ++c) errors.push_back(std::abs(got[c] - truth[c]));
    }
    for (const double error : errors) EXPECT_LT(error, 1e-3 * largest);
  }
}

TEST(PrefilterTest, SmallAndOddMapsWork) {
  for (const auto& [w, h] : {std::pair{1, 1}, {2, 1}, {5, 3}, {131, 67}}) {
    Picture picture(w, h);
    for (int i = 0; i < w * h; ++i) picture.pixels[i] = glm::vec4(i % 7, i % 3, 1, 1);
    const Environment environment = Environment::FromPicture(picture, "small").value();
    const PrefilteredEnvironment prefiltered(environment);
    EXPECT_LT(RelativeError(environment, prefiltered, 64.0f, 6), 0.02) << w << " x " << h;
    EXPECT_LT(RelativeError(environment, prefiltered, 0.25f, 6), 0.02) << w << " x " << h;
  }
}

TEST(PrefilterTest, TheBrightestLightAllowedStaysFinite) {
  Picture picture(32, 16);
  picture.at(5, 6) = glm::vec4(Environment::kMaxRadiance);
  picture.at(20, 0) = glm::vec4(Environment::kMaxRadiance);
  const Environment environment = Environment::FromPicture(picture, "bright").value();
  const PrefilteredEnvironment filtered(environment, 1);
  CounterRng rng(5, 8);
  for (int i = 0; i < 200; ++i) {
    const glm::vec3 d = Environment::Direction(rng.Uniform(), rng.Uniform());
    for (const float kappa : {0.0f, 0.4f, 3.0f, 700.0f, 1e5f, 1e9f}) {
      const glm::vec3 value = filtered.Filtered(d, kappa);
      EXPECT_TRUE(std::isfinite(value.x + value.y + value.z)) << kappa;
    }
    EXPECT_TRUE(std::isfinite(filtered.CosineAverage(d).x));
  }
  // What is no direction must not become an index either.
  for (const float kappa : {0.0f, 3.0f, 1e9f}) {
    EXPECT_TRUE(std::isfinite(filtered.Filtered(glm::vec3(0), kappa).x));
    EXPECT_TRUE(std::isfinite(filtered.Filtered(glm::vec3(std::nanf("")), kappa).x));
  }
}

TEST(PrefilterTest, TheSameForAnyNumberOfThreads) {
  const Environment environment = Environment::Procedural("sunset", 128).value();
  const PrefilteredEnvironment one(environment, 1), three(environment, 3);
  CounterRng rng(4, 3);
  for (int i = 0; i < 2000; ++i) {
    const glm::vec3 d = RandomDirection(rng);
    const float kappa = std::exp2(16 * rng.Uniform() - 2);
    EXPECT_EQ(one.Filtered(d, kappa), three.Filtered(d, kappa));
    EXPECT_EQ(one.CosineAverage(d), three.CosineAverage(d));
  }
}

TEST(OctahedralMapTest, DirectionsAreKeptAcrossAllEdges) {
  CounterRng rng(5, 3);
  OctahedralMap map(64);
  for (int y = 0; y <= 64; ++y)
    for (int x = 0; x <= 64; ++x) map.at(x, y) = glm::vec4(map.NodeDirection(x, y), 0);
  for (int i = 0; i < 5000; ++i) {
    const glm::vec3 d = RandomDirection(rng);
    const glm::vec2 p = OctahedralFromDirection(d);
    EXPECT_LT(glm::length(DirectionFromOctahedral(p) - d), 1e-5f);
    // Second order everywhere, the octahedron's edges included: width^2 / 4 for the widest cells.
    EXPECT_LT(glm::length(ToVec3(map.Interpolated(p)) - d), 0.0025f);
  }
  for (const glm::vec3& d :
       {glm::vec3(0, -1, 0), glm::vec3(0, 1, 0), glm::vec3(-1, 0, 0), glm::vec3(0, 0, -1)})
    EXPECT_LT(glm::length(ToVec3(map.Interpolated(OctahedralFromDirection(d))) - d), 0.0025f);
}

}  // namespace
}  // namespace glint
