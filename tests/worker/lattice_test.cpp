#include "worker/lattice.h"

#include <gtest/gtest.h>

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
    const glm::vec3& d = lattice.direction(c);
    EXPECT_NEAR(glm::length(d), 1, 1e-6);
    EXPECT_GT(d.z, 0);
    cosine += d.z * lattice.solid_angle();
    cosine2 += double{d.z} * d.z * lattice.solid_angle();
    x2 += double{d.x} * d.x * lattice.solid_angle();
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
    const HemisphereLattice::Cone& cone = lattice.tile_cone(tile);
    for (int i = 0; i < HemisphereLattice::kTileCells; ++i) {
      const int cell = tile * HemisphereLattice::kTileCells + i;
      EXPECT_GE(glm::dot(cone.axis, lattice.direction(cell)), cone.cos_radius - 1e-6f);
      for (int q = 0; q < 4; ++q)
        EXPECT_GE(glm::dot(cone.axis, lattice.quarter(cell, q)), cone.cos_radius - 1e-6f);
    }
  }
}

TEST_P(LatticeTest, NeighboursAreMutualAndNear) {
  const HemisphereLattice lattice(GetParam());
  int right = 0, below = 0;
  for (int c = 0; c < lattice.cells(); ++c) {
    for (const int other : {lattice.right(c), lattice.below(c)}) {
      if (other < 0) continue;
      EXPECT_LT(glm::length(lattice.direction(c) - lattice.direction(other)), 8.0f / lattice.side());
    }
    right += lattice.right(c) >= 0;
    below += lattice.below(c) >= 0;
  }
  EXPECT_EQ(right, lattice.side() * (lattice.side() - 1));
  EXPECT_EQ(below, lattice.side() * (lattice.side() - 1));
}

INSTANTIATE_TEST_SUITE_P(Sides, LatticeTest, testing::Values(4, 12, 16, 20, 84));

}  // namespace
}  // namespace glint
