// Light that goes from surface to surface: none may be made, and none may be lost beyond what is stated.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/scene/normals.h"
#include "tests/stability/stability_fixture.h"

namespace glint::stability {
namespace {

constexpr double kPi = std::numbers::pi;

/// Solid angle of a triangle of unit directions (Van Oosterom and Strackee 1983).
double SolidAngle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const double denominator = 1 + glm::dot(a, b) + glm::dot(b, c) + glm::dot(c, a);
  return 2 * std::atan2(std::abs(glm::dot(a, glm::cross(b, c))), denominator);
}

/// A hollow sphere of radius 1, fronts inwards, open where y > `rim`.
struct Cavity {
  Scene scene;
  double opening = 0;  ///< part of the sphere that is missing

  Cavity(const Material& material, double rim, int side) {
    MeshBuilder builder;
    const uint16_t m = builder.AddMaterial(material);
    builder.AddStarShape(
        side, [](const glm::dvec3& d) { return d; }, m);
    scene = builder.Finish(AnyCamera());
    std::vector<std::array<uint32_t, 3>> kept;
    double missing = 0;
    for (const auto& [a, b, c] : scene.triangles) {
      const glm::dvec3 p(scene.positions[a]), q(scene.positions[b]), r(scene.positions[c]);
      if ((p.y + q.y + r.y) / 3 > rim) {
        missing += SolidAngle(glm::normalize(p), glm::normalize(q), glm::normalize(r));
      } else {
        kept.push_back({a, c, b});
      }
    }
    opening = missing / (4 * kPi);
    scene.triangles = kept;
    scene.triangle_material.resize(kept.size());
    scene.normals = AngleWeightedNormals(scene.positions, scene.triangles);
    scene.content = HashScene(scene);
  }
};

/// Mean over the cavity's vertices of what they send to its middle.
glm::dvec3 MeanReflected(const Baked& baked, int layer) {
  std::vector<uint8_t> used(baked.domain().vertex_count(), 0);
  for (const auto& triangle : baked.domain().triangles)
    for (const uint32_t v : triangle) used[v] = 1;
  glm::dvec3 sum(0);
  for (uint32_t v = 0; v < used.size(); ++v)
    if (used[v]) sum += glm::dvec3(baked.ReflectedAt(v, -baked.domain().positions[v], layer));
  return sum / static_cast<double>(std::count(used.begin(), used.end(), 1));
}

class FurnaceTest : public testing::TestWithParam<GatherMethod> {
 protected:
  std::string Named(const std::string& what) const { return what + ", " + NameOf(GetParam()); }
};

// Between points of a sphere all form factors are alike, so that each reflection j of a Lambertian cavity is
// uniform: a f (a (1 - f))^j, f the open part. With a = 1 all of them add up to the sky's radiance, whatever
// the shape; and a other than 1 multiplies each reflection by a.
TEST_P(FurnaceTest, LambertianCavityReflectsItsGeometricSeries) {
  constexpr int kLayers = 14;
  const glm::vec3 albedo(1, 0.75f, 0.25f);
  const Cavity cavity(Lambert(albedo), 0.2, 6);
  const Baked baked(cavity.scene, {.method = GetParam(), .layers = kLayers, .grid_level = 0});
  ASSERT_EQ(baked.layers(), kLayers + 1);
  const double f = cavity.opening;
  double white_sum = 0, from_series = 0, from_white = 0;
  for (int layer = 0; layer <= kLayers; ++layer) {
    const glm::dvec3 mean = MeanReflected(baked, layer);
    white_sum += mean.x;
    for (int c = 0; c < 3; ++c) {
      const double a = albedo[c], power = std::pow(a, layer + 1);
      from_series = std::max(from_series, std::abs(mean[c] - power * f * std::pow(1 - f, layer)));
      from_white = std::max(from_white, std::abs(mean[c] - power * mean.x));
    }
  }
  ExpectAtMost(Named("cavity of albedo 1: sum of 15 reflections, from 1"), std::abs(white_sum - 1), 0.01);
  ExpectAtMost(Named("cavity: any reflection, from its closed form"), from_series, 0.03);
  ExpectAtMost(Named("cavity of albedo a: any reflection, from the white one's a^j"), from_white, 1e-3);
}

TEST_P(FurnaceTest, BlackSurfacesReflectNothing) {
  const Cavity cavity(Lambert(glm::vec3(0)), 0.2, 3);
  const Baked baked(cavity.scene, {.method = GetParam(), .layers = 3});
  double light = 0;
  for (int layer = 0; layer < baked.layers(); ++layer)
    light = std::max(light, glm::length(MeanReflected(baked, layer)));
  ExpectAtMost(Named("black cavity: light"), light, 0);
  EXPECT_EQ(baked.report().layers.back().stored[0], 0u);
}

TEST_P(FurnaceTest, NothingGetsIntoAClosedBox) {
  MeshBuilder builder;
  AddBox(glm::dvec3(-1), glm::dvec3(1), 4, true, builder.AddMaterial(Glossy()), &builder);
  const Baked baked(builder.Finish(AnyCamera()), {.method = GetParam(), .layers = 1});
  ExpectAtMost(Named("closed box: largest free part"), baked.LargestFree(), 0);
  EXPECT_EQ(baked.report().layers[1].stored[0], 0u);
}

INSTANTIATE_TEST_SUITE_P(Methods, FurnaceTest, testing::Values(GatherMethod::kShared, GatherMethod::kPaper),
                         [](const auto& m) { return m.param == GatherMethod::kShared ? "Shared" : "Paper"; });

// Any hollow with any opening: a white one sends out exactly what comes in.
RC_GTEST_PROP(FurnacePropertyTest, WhiteHollowsOfAnyShapeGiveBackWhatTheyGet, ()) {
  const double rim = *rc::gen::inRange(-5, 2) / 10.0;
  const uint32_t seed = *rc::gen::arbitrary<uint32_t>();
  Cavity cavity(Lambert(glm::vec3(1)), rim, 3);
  for (glm::vec3& p : cavity.scene.positions)  // lumps, not so large that the hollow folds
    p *= 1 + 0.2f * std::sin(3 * p.x + static_cast<float>(seed % 7)) *
                 std::cos(4 * p.z + static_cast<float>(seed % 5));
  cavity.scene.normals = AngleWeightedNormals(cavity.scene.positions, cavity.scene.triangles);
  cavity.scene.content = HashScene(cavity.scene);
  const Baked baked(cavity.scene, {.layers = 8, .grid_level = 0, .rays = 256});
  double sum = 0;
  for (int layer = 0; layer < baked.layers(); ++layer) sum += MeanReflected(baked, layer).x;
  RC_LOG() << "sum " << sum << std::endl;
  RC_ASSERT(std::abs(sum - 1) < 0.03);
}

}  // namespace
}  // namespace glint::stability
