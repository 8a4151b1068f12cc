#include "coordinator/spatial/lobe_sight.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"
#include "common/lobes/lobe_sky.h"

namespace glint {
namespace {

/// All light, reflected onward to an angle from the zenith.
LobeSight Mirroring(float angle, float light = 1) {
  return {0, light, light * glm::vec3(std::sin(angle), std::cos(angle), 0)};
}

SightBlend Blend(std::initializer_list<LobeSight> sights) {
  SightBlend blend;
  for (const LobeSight& s : sights) blend.Add(1, s);
  return blend;
}

TEST(SightErrorTest, NoneWhereAllSeeTheSame) {
  const SightError error(32);
  const LobeSight some{0.3f, 0.5f, 0.5f * glm::normalize(glm::vec3(1, 2, 3))};
  EXPECT_NEAR(error(some, Blend({some})), 0, 1e-5);
  EXPECT_NEAR(error(some, Blend({some, some, some})), 0, 1e-5);
  EXPECT_EQ(error({.open = 1}, Blend({{.open = 1}})), 0);
}

TEST(SightErrorTest, LightForDarknessIsAsWrongAsItGets) {
  const SightError error(32);
  EXPECT_NEAR(error({.open = 1}, Blend({LobeSight{}})), 2, 0.05);
  EXPECT_NEAR(error({}, Blend({{.open = 1}})), 2, 0.05);
  EXPECT_LT(error({.open = 1}, Blend({{.open = 1}, {.open = 0.5f}})), 0.2);
}

TEST(SightErrorTest, GrowsWithTheAngleAndTheSharperTheLobe) {
  double before = -1;
  for (const float angle : {0.0f, 0.2f, 0.4f, 0.8f}) {
    const double wrong = SightError(32)(Mirroring(0), Blend({Mirroring(angle)}));
    EXPECT_GT(wrong, before);
    before = wrong;
  }
  EXPECT_GT(SightError(128)(Mirroring(0), Blend({Mirroring(0.2f)})),
            2 * SightError(8)(Mirroring(0), Blend({Mirroring(0.2f)})));
}

TEST(SightErrorTest, LobesOnBothSidesAreAveragedUpToADistance) {
  const SightError error(32);
  EXPECT_NEAR(error(Mirroring(0), Blend({Mirroring(-0.2f), Mirroring(0.2f)})), 0, 1e-3);
  EXPECT_GT(error(Mirroring(0), Blend({Mirroring(-0.8f), Mirroring(0.8f)})), 0.2);
}

/// Against skies as the estimate draws them, to a factor of two.
TEST(SightErrorTest, IsThatUnderUnlikeSkies) {
  constexpr int kSkies = 20000;
  for (const float kappa : {16.0f, 128.0f})
    for (const float angle : {0.15f, 0.4f, 1.0f}) {
      CounterRng rng(7, 0, 0, 0);
      double difference = 0, squares = 0;
      for (int i = 0; i < kSkies; ++i) {
        const LobeSky sky(&rng);
        const glm::vec3 a = SampleVmf({{0, 0, 1}, 0}, rng.Uniform(), rng.Uniform());
        const Frame frame = Frame::FromNormal(a);
        const glm::vec3 b = std::cos(angle) * a + std::sin(angle) * frame.t;
        const double la = sky.Filtered({a, kappa / 2}), lb = sky.Filtered({b, kappa / 2});
        difference += (la - lb) * (la - lb);
        squares += 0.5 * (la * la + lb * lb);
      }
      const double wrong = SightError(kappa)(Mirroring(0), Blend({Mirroring(angle)}));
      EXPECT_NEAR(std::log(wrong / (difference / squares)), 0, std::log(2.0)) << kappa << " " << angle;
    }
}

}  // namespace
}  // namespace glint
