#include "common/render/pixel_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <set>
#include <utility>

namespace glint {
namespace {

// A (0,2)-sequence of 2^(a+b) points has one in every 2^-a by 2^-b box; scrambling must keep that.
TEST(PixelSamplesTest, OnePointInEveryElementaryInterval) {
  constexpr int kLog = 6;
  for (uint32_t pixel = 0; pixel < 50; ++pixel) {
    PixelSamples samples(3, 1u << kLog);
    samples.Start(7, pixel, pixel % 2);
    for (int a = 0; a <= kLog; ++a) {
      std::set<std::pair<int, int>> boxes;
      for (uint32_t i = 0; i < 1u << kLog; ++i) {
        const glm::vec2 p = samples.Point(2, i);
        ASSERT_GT(p.x, 0);
        ASSERT_LT(p.x, 1);
        ASSERT_GT(p.y, 0);
        ASSERT_LT(p.y, 1);
        boxes.emplace(static_cast<int>(std::ldexp(p.x, a)), static_cast<int>(std::ldexp(p.y, kLog - a)));
      }
      EXPECT_EQ(boxes.size(), 1u << kLog) << "pixel " << pixel << ", 2^" << a << " columns";
    }
  }
}

// Every single point is uniform over pixels, and pairs and streams are independent of one another.
TEST(PixelSamplesTest, EachPointIsUniformAndPairsAreIndependent) {
  constexpr int kPixels = 20000;
  PixelSamples samples(2, 8);
  glm::dvec4 mean(0), square(0);
  double product_pairs = 0, product_xy = 0, product_streams = 0, product_neighbours = 0;
  for (uint32_t pixel = 0; pixel < kPixels; ++pixel) {
    samples.Start(3, pixel, 0);
    const glm::dvec2 a = glm::dvec2(samples.Point(0, 5)) - 0.5, b = glm::dvec2(samples.Point(1, 5)) - 0.5;
    const glm::dvec2 far = glm::dvec2(samples.Point(0, 2)) - 0.5;
    samples.Start(3, pixel, 1);
    const glm::dvec2 c = glm::dvec2(samples.Point(0, 5)) - 0.5;
    const glm::dvec4 all(a.x, a.y, b.x, b.y);
    mean += all / double{kPixels};
    square += all * all / double{kPixels};
    product_xy += a.x * a.y / kPixels;
    product_pairs += a.x * b.x / kPixels;
    product_streams += a.x * c.x / kPixels;
    product_neighbours += a.x * far.y / kPixels;
  }
  const double sigma = std::sqrt(1 / 12.0 / kPixels);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(mean[i], 0, 4 * sigma);
    EXPECT_NEAR(square[i], 1 / 12.0, 4 * std::sqrt(1 / 180.0 / kPixels));
  }
  for (const double product : {product_xy, product_pairs, product_streams, product_neighbours}) {
    EXPECT_NEAR(product, 0, 4 / 12.0 / std::sqrt(double{kPixels}));
  }
}

TEST(PixelSamplesTest, DependsOnlyOnItsArguments) {
  PixelSamples a(4, 16), b(4, 16);
  a.Start(1, 2, 0);
  b.Start(9, 9, 1);
  b.Start(1, 2, 0);
  EXPECT_EQ(a.Point(3, 11), b.Point(3, 11));
  b.Start(2, 2, 0);
  EXPECT_NE(a.Point(3, 11), b.Point(3, 11));
}

}  // namespace
}  // namespace glint
