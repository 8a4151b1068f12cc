// Surfaces as they should not be, but are.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/base/frame.h"
#include "common/scene/load.h"
#include "common/scene/ray_scene.h"
#include "tests/stability/stability_fixture.h"
#include "worker/surface_vertices.h"

namespace glint::stability {
namespace {

constexpr double kTau = 2 * std::numbers::pi;

class GeometryTest : public testing::TestWithParam<GatherMethod> {
 protected:
  SmallBake Options(int layers = 0) const { return {.method = GetParam(), .layers = layers}; }
  std::string Named(const std::string& what) const { return what + ", " + NameOf(GetParam()); }
  /// Error of a free part near one half: 256 random rays have a standard deviation of 0.03.
  double Noise() const { return GetParam() == GatherMethod::kShared ? 0.015 : 0.12; }
};

/// Largest error of the free part along FloorByWall's middle row, whose first vertex is `first`.
double ErrorBesideWall(const Baked& baked, uint32_t first, size_t columns) {
  double worst = 0;
  for (uint32_t v = first; v < first + columns; ++v)
    worst = std::max(worst, std::abs(baked.FreeDiffuse(v) - FreeBesideWall(baked.domain().positions[v].x)));
  return worst;
}

const std::vector<double> kPlaces = {0.1, 0.2, 0.5, 1, 2};
constexpr uint32_t kMiddleRow = 4 + 5;  ///< of FloorByWall(kPlaces)

TEST_P(GeometryTest, SliversSeeWhatTheirPlaceSees) {
  for (const double width : {1e-3, 1e-5, 2.5e-7}) {
    const std::vector<double> x = {0.1, 0.1 + width, 0.5, 0.5 + width, 1, 1 + width, 2};
    const Baked baked(FloorByWall(x, Glossy()), Options());
    ExpectAtMost(Named("slivers " + Short(width) + " x 1000: error of the free part"),
                 ErrorBesideWall(baked, 4 + 7, 7), Noise());
  }
}

TEST_P(GeometryTest, ASingleTriangleIsFree) {
  MeshBuilder builder;
  builder.AddPatch({0, 0, 0}, {1, 0, 0}, {0, 0, -1}, 2, 2, builder.AddMaterial(Lambert(glm::vec3(0.7f))));
  Scene scene = builder.Finish(AnyCamera());
  scene.triangles = {{0, 1, 2}};
  scene.triangle_material.resize(1);
  scene.positions.pop_back();
  scene.normals.pop_back();
  scene.uvs.pop_back();
  scene.colors.pop_back();
  scene.vertex_material.pop_back();
  scene.content = HashScene(scene);
  const Baked baked(std::move(scene), Options(1));
  EXPECT_EQ(baked.report().layers[0].stored[0] + baked.report().layers[1].stored[0], 0u);
  const glm::vec3 wo = glm::normalize(glm::vec3(1, 2, 3));
  ExpectAtMost(Named("single triangle: reflected, from its albedo"),
               std::abs(baked.Reflected(0, 0.2f, 0.3f, wo, 0).x - 0.7f), 1e-6);
  EXPECT_EQ(baked.Reflected(0, 0.2f, 0.3f, -wo, 0), glm::vec3(0)) << "from behind";
}

TEST_P(GeometryTest, FacesWithoutAreaChangeNothing) {
  Scene scene = FloorByWall(kPlaces, Glossy());
  const auto faces = static_cast<uint32_t>(scene.triangles.size());
  scene.triangles.push_back({kMiddleRow, kMiddleRow, kMiddleRow + 1});      // two corners in one
  scene.triangles.push_back({kMiddleRow, kMiddleRow + 1, kMiddleRow + 2});  // three in a row
  scene.triangles.push_back({kMiddleRow + 1, kMiddleRow + 1, kMiddleRow + 1});
  scene.triangle_material.resize(scene.triangles.size(), 0);
  scene.content = HashScene(scene);
  const Baked baked(std::move(scene), Options(1));
  ExpectAtMost(Named("faces without area: error of the free part"),
               ErrorBesideWall(baked, kMiddleRow, kPlaces.size()), Noise());
  double reflected = 0;
  for (uint32_t t = faces; t < baked.domain().triangles.size(); ++t)
    for (uint32_t c = 0; c < baked.grid().size(); ++c)
      for (int layer = 0; layer < 2; ++layer)
        reflected =
            std::max<double>(reflected, baked.Reflected(t, 0.3f, 0.3f, baked.grid().direction(c), layer).x);
  ExpectAtMost(Named("faces without area: reflected at most"), reflected, 1);
}

/// Appends every face of the scene again, with vertices of its own; turned round if `turned`.
void Double(Scene* scene, bool turned) {
  const auto vertices = static_cast<uint32_t>(scene->positions.size());
  auto repeat = [](auto* values) {
    values->reserve(2 * values->size());
    values->insert(values->end(), values->begin(), values->end());
  };
  repeat(&scene->positions);
  repeat(&scene->normals);
  repeat(&scene->uvs);
  repeat(&scene->colors);
  repeat(&scene->vertex_material);
  repeat(&scene->triangle_material);
  const size_t faces = scene->triangles.size();
  for (size_t t = 0; t < faces; ++t) {
    const auto [a, b, c] = scene->triangles[t];
    if (turned) {
      scene->triangles.push_back({vertices + a, vertices + c, vertices + b});
    } else {
      scene->triangles.push_back({vertices + a, vertices + b, vertices + c});
    }
  }
  for (size_t v = vertices; turned && v < scene->normals.size(); ++v) scene->normals[v] = -scene->normals[v];
  scene->content = HashScene(*scene);
}

TEST_P(GeometryTest, CoincidentSurfacesAreOneSurface) {
  const Baked once(FloorByWall(kPlaces, Glossy()), Options(1));
  for (const bool turned : {false, true}) {
    Scene scene = FloorByWall(kPlaces, Glossy());
    Double(&scene, turned);
    const Baked twice(std::move(scene), Options(1));
    const std::string name = turned ? "coincident, back to back" : "coincident";
    ExpectAtMost(Named(name + ": error of the free part"), ErrorBesideWall(twice, kMiddleRow, kPlaces.size()),
                 Noise());
    double indirect = 0, expected = 0;
    const glm::vec3 up(0, 1, 0);
    for (uint32_t v = kMiddleRow; v < kMiddleRow + kPlaces.size(); ++v) {
      indirect += twice.ReflectedAt(v, up, 1).x;
      expected += once.ReflectedAt(v, up, 1).x;
    }
    // Which of two faces in one place a ray meets is the ray tracer's choice, and the back of one is black:
    // nothing can be said of what is lost there.
    ExpectAtMost(Named(name + ": indirect light, gained"), indirect / expected - 1, 0.05);
    if (!turned) ExpectAtMost(Named(name + ": indirect light, lost"), 1 - indirect / expected, 0.05);
  }
}

/// Part of the cosine-weighted hemisphere that is free, by many rays.
double FreeByRays(const RayScene& rays, const glm::vec3& position, const glm::vec3& normal) {
  constexpr int kRays = 4096;
  const Frame frame = Frame::FromNormal(normal);
  int free = 0;
  for (int i = 0; i < kRays; ++i) {
    const double r = std::sqrt((i + 0.5) / kRays), phi = kTau * std::fmod(i * 0.6180339887498949, 1.0);
    Ray ray;
    ray.origin = position + rays.epsilon() * normal;
    ray.direction = frame.ToWorld({r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - r * r)});
    free += !rays.Occluded(ray);
  }
  return static_cast<double>(free) / kRays;
}

TEST_P(GeometryTest, SurfacesThatCrossSeeWhatRaysSee) {
  MeshBuilder builder;
  const uint16_t material = builder.AddMaterial(Glossy());
  builder.AddPatch({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 8, 8, material);
  AddBox({-0.53, -0.61, -0.47}, {0.51, 0.67, 0.49}, 3, false, material, &builder);
  builder.AddStarShape(
      2, [](const glm::dvec3& d) { return glm::dvec3(0.7, 0.1, 0.4) + 0.3 * d; }, material);
  const Baked baked(builder.Finish(AnyCamera()), Options());
  const RayScene rays(baked.scene());
  double worst = 0, inside = 0;
  for (uint32_t v = 0; v < baked.domain().vertex_count(); ++v) {
    const glm::vec3 &p = baked.domain().positions[v], &n = baked.domain().normals[v];
    const bool buried = v < 64 && std::abs(p.x) < 0.5f && std::abs(p.z) < 0.45f;
    if (buried) inside = std::max(inside, baked.FreeDiffuse(v));
    worst = std::max(worst, std::abs(baked.FreeDiffuse(v) - FreeByRays(rays, p, n)));
  }
  ExpectAtMost(Named("surfaces that cross: error of the free part, against rays"), worst, 1.5 * Noise());
  ExpectAtMost(Named("floor inside a box: free part"), inside, 0);
}

TEST_P(GeometryTest, NothingReachesVerticesInsideOtherObjects) {
  MeshBuilder builder;
  const uint16_t material = builder.AddMaterial(Glossy());
  AddBox(glm::dvec3(-1), glm::dvec3(1), 3, false, material, &builder);
  const uint32_t inner = builder.vertex_count();
  builder.AddStarShape(
      2, [](const glm::dvec3& d) { return 0.3 * d; }, material);
  const Baked baked(builder.Finish(AnyCamera()), Options(1));
  double free = 0;
  for (uint32_t v = inner; v < baked.domain().vertex_count(); ++v) {
    free = std::max(free, baked.FreeDiffuse(v));
    for (uint32_t c = 0; c < baked.grid().size(); ++c)
      if (baked.Defined(v, c)) free = std::max(free, baked.FreeSpecular(v, c));
  }
  ExpectAtMost(Named("vertices inside a closed box: largest free part"), free, 0);
  EXPECT_EQ(baked.report().layers[1].stored[0], 0u);
}

TEST_P(GeometryTest, ThinClosedBoxesDoNotLeak) {
  for (const double thickness : {1e-1, 1e-2, 1e-3, 1e-4, 5e-5, 1e-5}) {
    MeshBuilder builder;
    AddBox({0, 0, 0}, {1, thickness, 1}, 3, true, builder.AddMaterial(Glossy()), &builder);
    Scene scene = builder.Finish(AnyCamera());
    const double epsilons = thickness / RayScene(scene).epsilon();
    const Baked baked(std::move(scene), Options());
    ExpectAtMost(Named("closed box, thickness " + Short(thickness) + " of its length, " + Short(epsilons) +
                       " epsilon: free part"),
                 baked.LargestFree(), epsilons > 2 ? 0 : 1);
  }
}

/// Part of the cosine-weighted hemisphere over the floor point (x, 0, z) that a slit in the ceiling at height
/// 1 takes up: |x - 0.5| < width / 2, 0 < z < 1.
double FormFactorOfSlit(double x, double z, double width) {
  constexpr int kSteps = 400;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < 8; ++j) {
      const double dx = 0.5 + width * ((j + 0.5) / 8 - 0.5) - x, dz = (i + 0.5) / kSteps - z;
      const double r2 = dx * dx + dz * dz + 1;
      sum += 1 / (r2 * r2);
    }
  return sum * width / (8 * kSteps) * 2 / kTau;
}

TEST_P(GeometryTest, NeedleThinGapsLetThroughWhatTheyAreWide) {
  for (const double width : {0.0, 1e-6, 1e-4, 1e-2, 0.1}) {
    MeshBuilder builder;
    const uint16_t material = builder.AddMaterial(Glossy());
    AddBox({0, 0, 0}, {1, 1, 1}, 5, true, material, &builder);
    Scene scene = builder.Finish(AnyCamera());
    // The ceiling's middle column of vertices becomes two, apart.
    for (size_t v = 0, count = scene.positions.size(); v < count; ++v) {
      if (scene.positions[v].y != 1 || scene.normals[v].y > -0.5f || scene.positions[v].x != 0.5f) continue;
      const auto twin = static_cast<uint32_t>(scene.positions.size());
      scene.positions.push_back(scene.positions[v]);
      scene.normals.push_back(scene.normals[v]);
      scene.uvs.push_back(scene.uvs[v]);
      scene.colors.push_back(scene.colors[v]);
      scene.vertex_material.push_back(scene.vertex_material[v]);
      scene.positions[v].x -= static_cast<float>(width / 2);
      scene.positions[twin].x += static_cast<float>(width / 2);
      for (auto& t : scene.triangles) {
        const bool right = scene.positions[t[0]].x + scene.positions[t[1]].x + scene.positions[t[2]].x > 1.5f;
        for (uint32_t& corner : t)
          if (corner == v && right) corner = twin;
      }
    }
    scene.content = HashScene(scene);
    const Baked baked(std::move(scene), Options());
    double worst = 0;
    for (uint32_t v = 0; v < baked.domain().vertex_count(); ++v) {
      const glm::vec3 p = baked.domain().positions[v];
      if (p.y != 0 || baked.domain().normals[v].y < 0.5f || std::min({p.x, p.z, 1 - p.x, 1 - p.z}) <= 0)
        continue;
      worst = std::max(worst, std::abs(baked.FreeDiffuse(v) - FormFactorOfSlit(p.x, p.z, width)));
    }
    ExpectAtMost(Named("gap " + Short(width) + " of the room: error of the free part"), worst,
                 width == 0 ? 0 : (width < 0.05 ? 0.02 : 0.5 * Noise() + 0.01));
  }
}

/// Normals turned by an angle about an axis across them.
void TurnNormals(double degrees, Scene* scene) {
  const double angle = degrees / 360 * kTau;
  for (glm::vec3& n : scene->normals)
    n = glm::normalize(static_cast<float>(std::cos(angle)) * n +
                       static_cast<float>(std::sin(angle)) * glm::vec3(n.y, n.z, n.x));
  scene->content = HashScene(*scene);
}

TEST_P(GeometryTest, NormalsAtOddsWithFacesLetNoLightIntoAClosedBox) {
  for (const double degrees : {30.0, 60.0, 80.0, 120.0, 180.0}) {
    MeshBuilder builder;
    AddBox(glm::dvec3(-1), glm::dvec3(1), 3, true, builder.AddMaterial(Glossy()), &builder);
    Scene scene = builder.Finish(AnyCamera());
    TurnNormals(degrees, &scene);
    const TempFolder folder;
    ASSERT_TRUE(SaveScene(scene, folder / "box.glb").ok());
    Result<Scene> loaded = LoadScene(folder / "box.glb");
    ASSERT_TRUE(loaded.ok());
    const Baked baked(std::move(loaded).value(), Options(1));
    double seen = 0;
    for (uint32_t t = 0; t < baked.domain().triangles.size(); ++t)
      for (uint32_t c = 0; c < baked.grid().size(); ++c)
        for (int layer = 0; layer < 2; ++layer)
          seen = std::max<double>(seen, baked.Reflected(t, 0.3f, 0.3f, baked.grid().direction(c), layer).x);
    ExpectAtMost(Named("closed box, normals turned by " + Short(degrees) + " degrees: light seen inside"),
                 seen, 0);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, GeometryTest, testing::Values(GatherMethod::kShared, GatherMethod::kPaper),
                         [](const auto& m) { return m.param == GatherMethod::kShared ? "Shared" : "Paper"; });

/// Faces around one vertex at the origin, up and down, near and far, welded.
Scene Fan(const std::vector<std::pair<int, int>>& spokes) {
  Scene scene;
  scene.materials = {Glossy()};
  scene.positions = {glm::vec3(0)};
  for (size_t i = 0; i < spokes.size(); ++i) {
    const double phi = kTau * static_cast<double>(i) / static_cast<double>(spokes.size());
    const double radius = 0.1 + spokes[i].first / 100.0;
    scene.positions.push_back(
        {radius * std::cos(phi), radius * spokes[i].second / 100.0, -radius * std::sin(phi)});
  }
  const auto count = static_cast<uint32_t>(spokes.size());
  for (uint32_t i = 0; i < count; ++i) scene.triangles.push_back({0, 1 + i, 1 + (i + 1) % count});
  scene.normals.assign(scene.positions.size(), glm::vec3(0, 1, 0));
  scene.uvs.assign(scene.positions.size(), glm::vec2(0));
  scene.colors.assign(scene.positions.size(), glm::vec4(1));
  scene.triangle_material.assign(scene.triangles.size(), 0);
  scene.vertex_material.assign(scene.positions.size(), 0);
  return scene;
}

// Hollow, ridge or saddle: rays that leave a vertex start on the side that they are to see.
RC_GTEST_PROP(GeometryPropertyTest, RaysStartInFrontOfTheFacesAround, ()) {
  const auto spokes = *rc::gen::resize(
      10, rc::gen::suchThat(rc::gen::container<std::vector<std::pair<int, int>>>(
                                rc::gen::pair(rc::gen::inRange(0, 100), rc::gen::inRange(-150, 150))),
                            [](const auto& s) { return s.size() >= 4 && s.size() <= 9; }));
  const Scene scene = Fan(spokes);
  const RayScene rays(scene);
  const BakeDomain domain = BuildBakeDomain(scene, {.max_lobes = 1}, 1);
  const SurfaceVertices surface(domain, rays.epsilon());
  for (const bool back : {false, true}) {
    const VertexSide side = surface.side(0, back);
    bool leaning = false;  // where faces hang over, there is no side
    for (uint32_t t = 0; t < domain.triangles.size(); ++t)
      leaning |= glm::dot(domain.FaceNormal(t), back ? -side.geometric : side.geometric) < 0.1f;
    RC_PRE(!leaning);
    Ray ray;
    ray.origin = side.origin;
    ray.direction = -side.geometric;
    const Hit down = rays.Intersect(ray);
    RC_ASSERT(down.hit());
    ray.direction = side.geometric;
    RC_ASSERT(!rays.Intersect(ray).hit());
  }
}

}  // namespace
}  // namespace glint::stability
