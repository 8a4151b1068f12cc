#include "worker/lattice.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <set>

#include "common/base/frame.h"

namespace glint {
namespace {

class LatticeTest : public testing::TestWithParam<int> {};

TEST_P(LatticeTest, IntegratesLowOrderFunctionsOverTheHemisphere) {
  const HemisphereLattice lattice(GetParam());
  double cosine = 0, cosine2 = 0, x2 = 0;
  glm::dvec3 mean(0);
  for (int c = 0; c < lattice.cells(); ++c) {
    const glm::vec3& d = lattice.direction(0, c);
    EXPECT_NEAR(glm::length(d), 1, 1e-6);
    EXPECT_GT(d.z, 0);
    cosine += d.z * lattice.solid_angle(0);
    cosine2 += double{d.z} * d.z * lattice.solid_angle(0);
    x2 += double{d.x} * d.x * lattice.solid_angle(0);
    mean += glm::dvec3(d);
  }
  // The midpoint rule's error falls with the number of cells.
  const double bound = 3.0 / lattice.cells();
  EXPECT_NEAR(cosine, kPi, bound * kPi);
  EXPECT_NEAR(cosine2, 2 * kPi / 3, bound * 3);
  EXPECT_NEAR(x2, 2 * kPi / 3, bound * 3);
  EXPECT_NEAR(mean.x / lattice.cells(), 0, 1e-5);
  EXPECT_NEAR(mean.y / lattice.cells(), 0, 1e-5);
}

TEST_P(LatticeTest, TileConesHoldTheirSamples) {
  const HemisphereLattice lattice(GetParam());
  for (int tile = 0; tile < lattice.tiles(); ++tile) {
    const ConeList::Cone& cone = lattice.tile_cone(tile);
    for (int i = 0; i < HemisphereLattice::kTileCells; ++i) {
      const int cell = tile * HemisphereLattice::kTileCells + i;
      for (int level = 0; level < HemisphereLattice::kLevels; ++level)
        for (int q = 0; q < 1 << (2 * level); ++q)
          EXPECT_GE(glm::dot(cone.axis, lattice.direction(level, (cell << (2 * level)) + q)),
                    cone.cos_radius - 1e-6f);
    }
  }
}

TEST_P(LatticeTest, PlacesAreOnePerSampleAndQuartersLieInTheirCell) {
  const HemisphereLattice lattice(GetParam());
  for (int level = 0; level < HemisphereLattice::kLevels; ++level) {
    const int side = lattice.side() << level;
    std::set<std::array<uint16_t, 2>> places;
    for (int i = 0; i < side * side; ++i) {
      const std::array<uint16_t, 2> place = lattice.place(level, i);
      EXPECT_TRUE(place[0] < side && place[1] < side);
      places.insert(place);
      if (level == 0) continue;
      const std::array<uint16_t, 2> whole = lattice.place(level - 1, i / 4);
      EXPECT_EQ(place[0] / 2, whole[0]);
      EXPECT_EQ(place[1] / 2, whole[1]);
      EXPECT_LT(glm::length(lattice.direction(level, i) - lattice.direction(level - 1, i / 4)),
                4.0f / static_cast<float>(side / 2));
    }
    EXPECT_EQ(places.size(), static_cast<size_t>(side) * side);
  }
}

TEST_P(LatticeTest, SamplesAlongTheHorizonLieInTurnsHighAndLow) {
  const HemisphereLattice lattice(GetParam());
  // A border cell spans heights up to 4 / side; its middle is at 2 / side.
  int low = 0, high = 0;
  for (int c = 0; c < lattice.cells(); ++c) {
    const auto [x, y] = lattice.place(0, c);
    if (x != 0 && y != 0 && x != lattice.side() - 1 && y != lattice.side() - 1) continue;
    const float middle = 1 - std::pow(1 - 1.0f / static_cast<float>(lattice.side()), 2.0f);
    (lattice.direction(0, c).z < middle ? low : high) += 1;
  }
  EXPECT_EQ(low, high);
}

INSTANTIATE_TEST_SUITE_P(Sides, LatticeTest, testing::Values(4, 12, 16, 20, 84));

}  // namespace
}  // namespace glint
