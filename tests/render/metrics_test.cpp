#include "common/render/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "common/base/rng.h"
#include "common/render/flip.h"

namespace glint {
namespace {

Picture Constant(int w, int h, float value) {
  Picture picture(w, h);
  for (glm::vec4& p : picture.pixels) p = glm::vec4(value, value, value, 1);
  return picture;
}

/// Smooth shapes of several sizes with some colour.
Picture Scene(int w, int h, int shift = 0) {
  Picture picture(w, h);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const float u = static_cast<float>(x + shift) / 9, v = static_cast<float>(y) / 7;
      picture.at(x, y) = glm::vec4(0.5f + 0.45f * std::sin(u), 0.4f + 0.35f * std::sin(v + u * 0.3f),
                                   0.3f + 0.25f * std::cos(2 * v), 1);
    }
  return picture;
}

Picture Noisy(const Picture& picture, float amount) {
  Picture noisy = picture;
  CounterRng rng(9, 1);
  for (glm::vec4& p : noisy.pixels)
    for (int c = 0; c < 3; ++c) p[c] = std::max(0.0f, p[c] + amount * (2 * rng.Uniform() - 1));
  return noisy;
}

Picture Blurred(const Picture& picture) {
  Picture blurred = picture;
  for (int y = 1; y + 1 < picture.height; ++y)
    for (int x = 1; x + 1 < picture.width; ++x) {
      glm::vec4 sum(0);
      for (int i = 0; i < 9; ++i) sum += picture.at(x + i % 3 - 1, y + i / 3 - 1);
      blurred.at(x, y) = sum / 9.0f;
    }
  return blurred;
}

double MeanFlip(const Picture& test, const Picture& reference) {
  const std::vector<float> map = FlipMap(test, reference, {.exposure = 1, .reinhard = false}).value();
  for (const float value : map) {
    EXPECT_GE(value, 0);
    EXPECT_LE(value, 1);
  }
  return std::accumulate(map.begin(), map.end(), 0.0) / static_cast<double>(map.size());
}

CompareOptions Masked(const Picture& mask) {
  CompareOptions options;
  options.mask = &mask;
  return options;
}

CompareOptions Blocks(int side) {
  CompareOptions options;
  options.block = side;
  return options;
}

TEST(MetricsTest, IdenticalPicturesDoNotDiffer) {
  const Picture picture = Scene(48, 32);
  const Comparison c = Compare(picture, picture).value();
  EXPECT_EQ(c.rel_mse, 0);
  EXPECT_EQ(c.mean_relative, 0);
  EXPECT_EQ(c.flip, 0);
  EXPECT_GE(c.psnr_db, 100);
  EXPECT_EQ(c.pixels, 48u * 32);
}

TEST(MetricsTest, ClosedForms) {
  // r = 1, t = 1.1: eps = 0.1, relMSE = 0.01 / 1.01, mean relative = 0.1 / 1.1.
  const Comparison c = Compare(Constant(8, 8, 1.1f), Constant(8, 8, 1)).value();
  EXPECT_NEAR(c.rel_mse, 0.01 / 1.01, 1e-7);
  EXPECT_NEAR(c.mean_relative, 0.1 / 1.1, 1e-7);
  EXPECT_NEAR(c.mean_test, 1.1, 1e-6);
  // Clamped display values 0 and 1: mean square error 1.
  CompareOptions linear;
  linear.tone.reinhard = false;
  EXPECT_NEAR(Compare(Constant(8, 8, 0), Constant(8, 8, 1), linear).value().psnr_db, 0, 1e-6);
}

TEST(MetricsTest, OnlyCountedPixelsCount) {
  Picture reference = Constant(8, 4, 1), test = reference, mask = Constant(8, 4, 1);
  test.at(2, 1) = glm::vec4(100, 0, 0, 1);
  EXPECT_GT(Compare(test, reference).value().rel_mse, 1);
  mask.at(2, 1) = glm::vec4(0);
  const Comparison masked = Compare(test, reference, Masked(mask)).value();
  EXPECT_EQ(masked.rel_mse, 0);
  EXPECT_EQ(masked.pixels, 31u);
  reference.at(2, 1).w = 0;  // not covered
  EXPECT_EQ(Compare(test, reference).value().rel_mse, 0);
  const Picture nothing(8, 4);
  EXPECT_EQ(Compare(test, reference, Masked(nothing)).status().kind(), ErrorKind::kBadInput);
}

TEST(MetricsTest, BlocksHideNoise) {
  const Picture reference = Constant(64, 64, 1), test = Noisy(reference, 0.3f);
  const double pixels = Compare(test, reference).value().rel_mse;
  const double blocks = Compare(test, reference, Blocks(4)).value().rel_mse;
  EXPECT_NEAR(pixels / blocks, 16, 4);
  // Borders that do not fill a block still count.
  EXPECT_TRUE(Compare(Constant(7, 5, 1), Constant(7, 5, 1), Blocks(4)).ok());
}

TEST(MetricsTest, DifferentSizesAreRefused) {
  const Picture a = Constant(8, 4, 1), b = Constant(4, 8, 1);
  EXPECT_EQ(Compare(a, b).status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(FlipMap(a, b).status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(FalseColorDifference(a, b).status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(Compare(a, a, Masked(b)).status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(Compare(Picture(), Picture()).status().kind(), ErrorKind::kBadInput);
}

TEST(MetricsTest, PicturesThatAreNotFiniteAreRefused) {
  const Picture good = Constant(8, 4, 1);
  for (const float value : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
    Picture bad = good;
    bad.at(5, 2).y = bad.at(6, 3).x = value;
    for (const auto& [test, reference] :
         {std::pair<const Picture*, const Picture*>(&bad, &good), {&good, &bad}}) {
      for (const Status& status : {Compare(*test, *reference).status(), FlipMap(*test, *reference).status(),
                                   FalseColorDifference(*test, *reference).status()}) {
        EXPECT_EQ(status.kind(), ErrorKind::kBadInput);
        EXPECT_NE(status.message().find("(5, 2)"), std::string::npos) << status.message();
      }
    }
  }
  const Comparison bright = Compare(Constant(8, 4, 3e38f), Constant(8, 4, 2e38f), Blocks(4)).value();
  EXPECT_TRUE(std::isfinite(bright.rel_mse + bright.mean_relative + bright.psnr_db + bright.flip));
}

TEST(MetricsTest, DifferencePicturesHonourTheMask) {
  Picture reference = Constant(8, 4, 1), test = Constant(8, 4, 1.05f), mask = Constant(8, 4, 1);
  reference.at(2, 1) = glm::vec4(1e4f, 1e4f, 1e4f, 1);  // lifts eps for all, unless it does not count
  mask.at(2, 1) = glm::vec4(0);
  const Picture all = FalseColorDifference(test, reference).value();
  const Picture masked = FalseColorDifference(test, reference, &mask).value();
  EXPECT_EQ(masked.at(2, 1), glm::vec4(0));
  EXPECT_GT(masked.at(3, 1).x, all.at(3, 1).x);
  EXPECT_EQ(masked.at(3, 1).w, 1);
  const Picture small(4, 4);
  EXPECT_EQ(FalseColorDifference(test, reference, &small).status().kind(), ErrorKind::kBadInput);
}

TEST(FlipTest, BlackAgainstWhiteIsNearlyOne) {
  // Closed form: HyAB distance 100, against the largest, green to blue, of about 204: the redistribution
  // gives 0.967.
  EXPECT_NEAR(MeanFlip(Constant(40, 40, 0), Constant(40, 40, 1)), 0.967, 0.002);
}

TEST(FlipTest, GreenAgainstBlueIsOne) {
  Picture green = Constant(40, 40, 0), blue = green;
  for (glm::vec4& p : green.pixels) p.y = 1;
  for (glm::vec4& p : blue.pixels) p.z = 1;
  EXPECT_NEAR(MeanFlip(green, blue), 1, 0.005);  // the distance that the scale is made from
}

TEST(FlipTest, Symmetric) {
  const Picture a = Scene(40, 30), b = Noisy(a, 0.2f);
  EXPECT_NEAR(MeanFlip(a, b), MeanFlip(b, a), 1e-6);
}

TEST(FlipTest, GrowsWithTheDifference) {
  const Picture scene = Scene(64, 48);
  double last = 0;
  for (const float amount : {0.02f, 0.05f, 0.1f, 0.2f, 0.4f}) {
    const double flip = MeanFlip(Noisy(scene, amount), scene);
    EXPECT_GT(flip, last);
    last = flip;
  }
  last = 0;
  for (const int shift : {1, 2, 4, 8}) {
    const double flip = MeanFlip(Scene(64, 48, shift), scene);
    EXPECT_GT(flip, last);
    last = flip;
  }
}

TEST(FlipTest, SeesBlurOfEdgesMoreThanOfSmoothPictures) {
  Picture checks(64, 64);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x)
      checks.at(x, y) = glm::vec4(glm::vec3((x / 8 + y / 8) % 2 == 0 ? 0.8f : 0.2f), 1);
  const double edges = MeanFlip(Blurred(checks), checks),
               smooth = MeanFlip(Blurred(Scene(64, 64)), Scene(64, 64));
  EXPECT_GT(edges, 3 * smooth);
  EXPECT_LT(edges, 0.5);
}

TEST(FlipTest, AVeryFinePatternVanishesFromAfar) {
  // One-pixel stripes against their mean: at fewer pixels a degree they are plain to see.
  std::vector<glm::vec3> stripes(64 * 64), flat(64 * 64, glm::vec3(0.5f));
  for (size_t i = 0; i < stripes.size(); ++i) stripes[i] = glm::vec3(i % 2 == 0 ? 0.3f : 0.7f);
  const auto mean = [&](float ppd) {
    const std::vector<float> map = Flip(stripes, flat, 64, 64, ppd);
    return std::accumulate(map.begin(), map.end(), 0.0) / 4096;
  };
  EXPECT_LT(mean(134), 0.5 * mean(16));
}

TEST(MetricsTest, FalseColorsRiseInLightness) {
  Picture reference = Constant(32, 1, 1), test = reference;
  for (int x = 0; x < 32; ++x) test.at(x, 0) = glm::vec4(glm::vec3(1 + static_cast<float>(x) / 28), 1);
  const Picture colors = FalseColorDifference(test, reference).value();
  float last = -1;
  for (int x = 0; x < 32; ++x) {
    const glm::vec4& c = colors.at(x, 0);
    const float luminance = 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z;
    EXPECT_GT(luminance, last) << x;
    EXPECT_LE(std::max({c.x, c.y, c.z}), 1);
    last = luminance;
  }
}

}  // namespace
}  // namespace glint
