#include "common/render/environment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "common/base/frame.h"
#include "common/base/rng.h"
#include "tests/render/render_test_support.h"

namespace glint {
namespace {

glm::vec3 RandomDirection(CounterRng& rng) {
  const float y = 2 * rng.Uniform() - 1, phi = 2 * kPi * rng.Uniform(), r = std::sqrt(1 - y * y);
  return {r * std::cos(phi), y, r * std::sin(phi)};
}

/// One bright texel on black.
Environment OneTexel(int x, int y) {
  Picture picture(16, 8);
  picture.at(x, y) = glm::vec4(1, 2, 3, 1);
  return Environment::FromPicture(picture, "one").value();
}

TEST(EnvironmentTest, ConventionsOfTheImage) {
  const auto near = [](const glm::vec3& a, const glm::vec3& b) { return glm::length(a - b) < 1e-5f; };
  EXPECT_TRUE(near(Environment::Direction(0.5f, 0.5f), {1, 0, 0}));
  EXPECT_TRUE(near(Environment::Direction(0.25f, 0.5f), {0, 0, -1}));
  EXPECT_TRUE(near(Environment::Direction(0.75f, 0.5f), {0, 0, 1}));
  EXPECT_TRUE(near(Environment::Direction(0.3f, 0), {0, 1, 0}));
  CounterRng rng(1, 2);
  for (int i = 0; i < 200; ++i) {
    const glm::vec3 d = RandomDirection(rng);
    const glm::vec2 uv = Environment::Coordinates(d);
    EXPECT_TRUE(near(Environment::Direction(uv.x, uv.y), d));
  }
}

TEST(EnvironmentTest, RadianceIsBilinearAndWraps) {
  const Environment environment = OneTexel(0, 3);
  const auto at = [&](float x, float y) {
    return environment.Radiance(Environment::Direction(x / 16, y / 8)).x;
  };
  EXPECT_NEAR(at(0.5f, 3.5f), 1, 1e-4f);
  EXPECT_NEAR(at(1.0f, 3.5f), 0.5f, 1e-4f);
  EXPECT_NEAR(at(0.0f, 3.5f), 0.5f, 1e-4f);
  EXPECT_NEAR(at(15.75f, 3.5f), 0.25f, 1e-4f);
  EXPECT_NEAR(at(0.5f, 3.25f), 0.75f, 1e-4f);
  EXPECT_EQ(at(2, 3.5f), 0);
  EXPECT_NEAR(OneTexel(4, 0).Radiance({0, 1, 0}).y, 0, 1e-6f);  // straight up lies in column 8, clamped in v
}

TEST(EnvironmentTest, BadValues) {
  Picture picture(4, 2);
  picture.at(1, 1).y = -3;
  const auto clamped = Environment::FromPicture(picture, "e");
  ASSERT_TRUE(clamped.ok());
  EXPECT_EQ(clamped->clamped(), 1u);
  EXPECT_EQ(clamped->texels()[5].y, 0);
  picture.at(2, 0).z = std::numeric_limits<float>::infinity();
  const auto refused = Environment::FromPicture(picture, "e");
  EXPECT_EQ(refused.status().kind(), ErrorKind::kBadInput);
  EXPECT_NE(refused.status().message().find("(2, 0)"), std::string::npos);
  picture.at(2, 0).z = 3e38f;  // finite, but no sum over it would be
  const auto bright = Environment::FromPicture(picture, "e");
  EXPECT_EQ(bright.status().kind(), ErrorKind::kBadInput);
  EXPECT_NE(bright.status().message().find("(2, 0)"), std::string::npos);
  EXPECT_FALSE(Environment::FromPicture(Picture(), "e").ok());
  EXPECT_EQ(Environment::Open("procedural:moon").status().kind(), ErrorKind::kUsage);
}

TEST(EnvironmentTest, TurningMovesTheLightAboutY) {
  const Environment environment = Environment::Procedural("sunset", 128).value();
  // A light seen at d appears at R_Y(r) d once the environment is turned by r.
  CounterRng rng(3, 2);
  for (int i = 0; i < 100; ++i) {
    const glm::vec3 d = RandomDirection(rng);
    const float degrees = 360 * rng.Uniform() - 180, a = degrees * kPi / 180;
    const glm::vec3 turned(std::cos(a) * d.x + std::sin(a) * d.z, d.y, std::cos(a) * d.z - std::sin(a) * d.x);
    EXPECT_LT(glm::length(RotateForLookup(turned, degrees) - d), 1e-5f);
  }
  // Turned by +90 degrees about +Y, what was at +X is at -Z; and the map is not its own turned copy.
  EXPECT_LT(glm::length(RotateForLookup({0, 0, -1}, 90) - glm::vec3(1, 0, 0)), 1e-6f);
  const glm::vec3 sun = Environment::Direction(0.5f - 50.0f / 360, 0.5f - 9.0f / 180);
  EXPECT_GT(environment.Radiance(sun).x, 20 * environment.Radiance(RotateForLookup(sun, 90)).x);
}

TEST(EnvironmentTest, LookUpsAreSafeWithWhatIsNoDirectionOrAngle) {
  const Environment environment = OneTexel(0, 3);
  const float nan = std::numeric_limits<float>::quiet_NaN(),
              infinite = std::numeric_limits<float>::infinity();
  for (const glm::vec3& d : {glm::vec3(nan), glm::vec3(1, nan, 0), glm::vec3(nan, 1, 0), glm::vec3(0),
                             glm::vec3(infinite), glm::vec3(0, -infinite, infinite)}) {
    EXPECT_TRUE(std::isfinite(environment.Radiance(d).x));
    EXPECT_TRUE(std::isfinite(environment.Pdf(d)));
  }
  const glm::vec3 d(0.6f, 0, 0.8f);
  for (const float degrees : {nan, infinite, -infinite}) EXPECT_EQ(RotateForLookup(d, degrees), d);
  EXPECT_LT(glm::length(RotateForLookup(d, 360e6f + 64) - RotateForLookup(d, 64)), 1e-6f);
}

TEST(EnvironmentTest, ProceduralSkiesAreFiniteAndLit) {
  for (const char* name : {"studio", "sunset", "uniform"}) {
    const auto environment = Environment::Open(std::string("procedural:") + name);
    ASSERT_TRUE(environment.ok()) << environment.status().message();
    EXPECT_EQ(environment->width(), 512);
    EXPECT_EQ(environment->height(), 256);
    double sum = 0;
    for (const glm::vec3& texel : environment->texels()) {
      EXPECT_GE(std::min({texel.x, texel.y, texel.z}), 0);
      sum += Luminance(texel);
    }
    EXPECT_GT(sum / static_cast<double>(environment->texels().size()), 0.05);
  }
}

/// Chi-square of samples in 32 x 16 cells against the density integrated over them.
void ChiSquare(const Environment& environment, const char* name) {
  constexpr int kColumns = 32, kRows = 16, kSamples = 200000, kSub = 16;
  std::vector<double> expected(size_t{kColumns} * kRows, 0), count(expected.size(), 0);
  double integral = 0;
  for (int y = 0; y < kRows * kSub; ++y)
    for (int x = 0; x < kColumns * kSub; ++x) {
      const double top = (0.5 - double(y) / (kRows * kSub)) * kPi,
                   bottom = (0.5 - double(y + 1) / (kRows * kSub)) * kPi;
      const double solid_angle = (std::sin(top) - std::sin(bottom)) * 2 * kPi / (kColumns * kSub);
      const glm::vec3 d =
          Environment::Direction((float(x) + 0.5f) / (kColumns * kSub), (float(y) + 0.5f) / (kRows * kSub));
      const double p = environment.Pdf(d) * solid_angle;
      expected[size_t(y / kSub) * kColumns + x / kSub] += p * kSamples;
      integral += p;
    }
  EXPECT_NEAR(integral, 1, 1e-3) << name;
  CounterRng rng(11, 1);
  for (int i = 0; i < kSamples; ++i) {
    const float u = rng.Uniform(), v = rng.Uniform();
    const Environment::Sample sample = environment.SampleDirection(u, v);
    EXPECT_NEAR(glm::length(sample.direction), 1, 1e-5f);
    const glm::vec2 uv = Environment::Coordinates(sample.direction);
    const int x = std::min(int(uv.x * kColumns), kColumns - 1), y = std::min(int(uv.y * kRows), kRows - 1);
    count[size_t(y) * kColumns + x] += 1;
    if (i < 1000) {
      EXPECT_NEAR(environment.Pdf(sample.direction) / sample.pdf, 1, 0.02f) << name;
    }
  }
  double chi = 0, rest_expected = 0, rest_count = 0;
  int cells = 0;
  for (size_t i = 0; i < count.size(); ++i) {
    if (expected[i] < 8) {
      rest_expected += expected[i], rest_count += count[i];
      continue;
    }
    chi += (count[i] - expected[i]) * (count[i] - expected[i]) / expected[i];
    ++cells;
  }
  EXPECT_LT(std::abs(rest_count - rest_expected), 5 * std::sqrt(rest_expected + 1) + 1) << name;
  // Mean cells, variance 2 cells: five standard deviations.
  EXPECT_LT(chi, cells + 5 * std::sqrt(2.0 * cells)) << name;
}

TEST(EnvironmentTest, SamplesFollowTheirDensity) {
  // 256 x 128 texels: the test's own integration has two points a texel.
  for (const char* name : {"studio", "sunset", "uniform"})
    ChiSquare(Environment::Procedural(name, 256).value(), name);
  ChiSquare(OneTexel(15, 0), "one texel");
  ChiSquare(Environment::FromPicture(Picture(16, 8), "black").value(), "black");
}

TEST(EnvironmentTest, DensityIsPositiveWhereverThereIsLight) {
  const Environment environment = OneTexel(15, 6);
  CounterRng rng(4, 2);
  int lit = 0;
  for (int i = 0; i < 20000; ++i) {
    const glm::vec3 d = RandomDirection(rng);
    if (environment.Radiance(d).x <= 1e-5f)
      continue;  // on the very edge of the footprint rounding may decide
    ++lit;
    EXPECT_GT(environment.Pdf(d), 0);
  }
  EXPECT_GT(lit, 100);
}

TEST(EnvironmentTest, EstimateOfTheIntegralIsUnbiased) {
  const Environment environment = Environment::Procedural("sunset", 256).value();
  double truth = 0, estimate = 0, square = 0;
  for (int y = 0; y < 512; ++y)
    for (int x = 0; x < 1024; ++x) {
      const float v = (float(y) + 0.5f) / 512;
      truth += environment.Radiance(Environment::Direction((float(x) + 0.5f) / 1024, v)).y *
               std::sin(v * kPi) * kPi / 512 * 2 * kPi / 1024;
    }
  constexpr int kSamples = 20000;
  CounterRng rng(5, 2);
  for (int i = 0; i < kSamples; ++i) {
    const float u = rng.Uniform(), v = rng.Uniform();
    const Environment::Sample s = environment.SampleDirection(u, v);
    const double value = environment.Radiance(s.direction).y / s.pdf;
    estimate += value / kSamples;
    square += value * value / kSamples;
  }
  EXPECT_NEAR(estimate, truth, 5 * std::sqrt((square - estimate * estimate) / kSamples));
}

}  // namespace
}  // namespace glint
