#include "common/render/reference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <string>

#include "common/base/frame.h"
#include "common/scene/generate.h"

namespace glint {
namespace {

Scene Generated(const std::string& name, uint32_t vertices) {
  GenerateOptions options;
  options.vertices = vertices;
  Result<Scene> scene = GenerateScene(name, options);
  EXPECT_TRUE(scene.ok()) << scene.status().message();
  return std::move(scene).value();
}

Environment Sky(const std::string& name, int width = 64) {
  Result<Environment> sky = Environment::Procedural(name, width);
  EXPECT_TRUE(sky.ok()) << sky.status().message();
  return std::move(sky).value();
}

/// A square of side 2 in the plane y = 0, front side up.
Scene Square(const Material& material) {
  Scene scene;
  scene.positions = {{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}};
  scene.normals.assign(4, {0, 1, 0});
  scene.uvs.assign(4, glm::vec2(0));
  scene.colors.assign(4, glm::vec4(1));
  scene.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.triangle_material.assign(2, 0);
  scene.vertex_material.assign(4, 0);
  scene.materials = {material};
  return scene;
}

Material Lambert(float albedo) {
  Material material;
  material.model = MaterialModel::kPhong;
  material.diffuse = glm::vec3(albedo);
  return material;
}

Material RoughMetal(float roughness) {
  Material material;
  material.base_color = {0.9f, 0.6f, 0.3f};
  material.roughness = roughness;
  return material;
}

View ViewOf(const glm::vec3& eye, const glm::vec3& target, float fov, int size) {
  View view;
  view.camera.eye = eye;
  view.camera.forward = glm::normalize(target - eye);
  view.camera.up = std::abs(view.camera.forward.y) > 0.9f ? glm::vec3{1, 0, 0} : glm::vec3{0, 1, 0};
  view.camera.vertical_fov = fov;
  view.width = view.height = size;
  return view;
}

ReferenceOptions Options(int bounces, int samples) {
  ReferenceOptions options;
  options.bounces = bounces;
  options.samples = samples;
  return options;
}

ReferenceResult Trace(const Scene& scene, const Environment& sky, const View& view,
                      const ReferenceOptions& options) {
  const RayScene rays(scene);
  Result<ReferenceResult> result = RenderReference(scene, rays, nullptr, sky, view, options);
  EXPECT_TRUE(result.ok()) << result.status().message();
  return std::move(result).value();
}

/// Mean colour of fully covered pixels.
glm::dvec3 MeanCovered(const Picture& picture) {
  glm::dvec3 sum(0);
  int count = 0;
  for (const glm::vec4& p : picture.pixels) {
    if (p.w < 1) continue;
    sum += glm::dvec3(p);
    ++count;
  }
  EXPECT_GT(count, 0);
  return sum / static_cast<double>(std::max(count, 1));
}

/// integral of f cos L over the hemisphere around +Y by a fine midpoint rule in (y^2, phi).
glm::dvec3 Quadrature(const Brdf& brdf, const glm::vec3& wo, const Environment& sky, float rotation_deg) {
  constexpr int kRings = 600, kSectors = 1200;
  const Frame frame = Frame::FromNormal({0, 1, 0});
  const glm::vec3 wo_local = frame.ToLocal(wo);
  glm::dvec3 sum(0);
  for (int i = 0; i < kRings; ++i) {
    const float z = (static_cast<float>(i) + 0.5f) / kRings, r = std::sqrt(1 - z * z);
    for (int j = 0; j < kSectors; ++j) {
      const float phi = 2 * kPi * (static_cast<float>(j) + 0.5f) / kSectors;
      const glm::vec3 wi{r * std::cos(phi), r * std::sin(phi), z};
      sum += glm::dvec3(EvaluateCosine(brdf, wo_local, wi) *
                        sky.Radiance(RotateForLookup(frame.ToWorld(wi), rotation_deg)));
    }
  }
  return sum * (2.0 * kPi / kRings / kSectors);
}

TEST(ReferenceTest, WhiteFurnaceKeepsALambertSphereInvisible) {
  Scene scene = Generated("sphere", 4000);
  scene.materials = {Lambert(1)};
  const ReferenceResult result =
      Trace(scene, Sky("uniform"), ViewOf({0, 0, 4}, {0, 0, 0}, 0.6f, 32), Options(3, 64));
  const glm::dvec3 mean = MeanCovered(result.picture);
  // Facets hide a little of what lies above the interpolated horizon: 1 % at this size of mesh.
  EXPECT_NEAR(mean.x, 1, 0.01);
  for (const glm::vec4& p : result.picture.pixels) EXPECT_NEAR(p.x, p.w, 0.12f);
}

TEST(ReferenceTest, RoughMetalSquareHasItsAlbedoInTheFurnace) {
  for (const float roughness : {0.1f, 0.5f, 1.0f}) {
    const Scene scene = Square(RoughMetal(roughness));
    const glm::vec3 eye{0, 2, 3};
    const ReferenceResult result =
        Trace(scene, Sky("uniform"), ViewOf(eye, {0, 0, 0}, 0.01f, 8), Options(1, 256));
    const Brdf brdf = ToBrdf(EvaluateMaterial(scene, 0, 0.3f, 0.3f));
    const glm::dvec3 albedo = Quadrature(brdf, glm::normalize(eye), Sky("uniform"), 0);
    const glm::dvec3 mean = MeanCovered(result.picture);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c] / albedo[c], 1, 0.004) << "roughness " << roughness;
  }
}

// The joint estimator against plain quadrature under a sky with a small sun, turned: rotation, both samplers,
// and their densities must all be right for this.
TEST(ReferenceTest, SquareUnderTurnedSunsetMatchesQuadrature) {
  const Environment sky = Sky("sunset", 128);
  for (const float roughness : {0.3f, 0.8f}) {
    const Scene scene = Square(RoughMetal(roughness));
    const glm::vec3 eye{0.5f, 1, 2};
    View view = ViewOf(eye, {0, 0, 0}, 0.01f, 8);
    const Brdf brdf = ToBrdf(EvaluateMaterial(scene, 0, 0.3f, 0.3f));
    for (const float rotation : {0.0f, 75.0f}) {
      view.environment_rotation_deg = rotation;
      const glm::dvec3 truth = Quadrature(brdf, glm::normalize(eye), sky, rotation);
      const glm::dvec3 mean = MeanCovered(Trace(scene, sky, view, Options(0, 1024)).picture);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(mean[c] / truth[c], 1, 0.01) << "roughness " << roughness << ", turned " << rotation;
      }
    }
  }
}

TEST(ReferenceTest, ConvexObjectHasNoIndirectLight) {
  const Scene scene = Generated("sphere", 2000);
  ReferenceOptions options = Options(2, 16);
  options.first_bounce = 1;
  const ReferenceResult result = Trace(scene, Sky("studio"), ViewOf({0, 1, 4}, {0, 0, 0}, 0.6f, 48), options);
  for (const glm::vec4& p : result.picture.pixels) EXPECT_EQ(glm::vec3(p), glm::vec3(0));
}

TEST(ReferenceTest, NoLightLeaksIntoAClosedBox) {
  const Scene scene = Generated("furnace", 600);
  View view;
  view.camera = scene.cameras.at(0);
  view.width = view.height = 48;
  const ReferenceResult result = Trace(scene, Sky("uniform"), view, Options(6, 32));
  for (const glm::vec4& p : result.picture.pixels) EXPECT_EQ(p, glm::vec4(0, 0, 0, 1));
}

TEST(ReferenceTest, BouncesAddUpAndNeverExceedTheFurnace) {
  Scene scene = Generated("planes", 600);
  for (Material& material : scene.materials) material = Lambert(1);
  View view;
  view.camera = scene.cameras.at(0);
  view.width = view.height = 32;
  const Environment sky = Sky("uniform");
  glm::dvec3 sum(0);
  for (int bounce = 0; bounce <= 3; ++bounce) {
    ReferenceOptions options = Options(bounce, 32);
    options.first_bounce = bounce;
    sum += MeanCovered(Trace(scene, sky, view, options).picture);
  }
  const glm::dvec3 together = MeanCovered(Trace(scene, sky, view, Options(3, 32)).picture);
  EXPECT_NEAR(sum.x, together.x, 1e-5);  // the same paths, split by length
  const double long_paths = MeanCovered(Trace(scene, sky, view, Options(40, 32)).picture).x;
  EXPECT_GT(long_paths, together.x);
  // 1 after infinitely many bounces; the two squares lose light fast enough for 40 to come close.
  EXPECT_NEAR(long_paths, 1, 0.02);
}

TEST(ReferenceTest, BrdfSamplesAloneFindTheSameLight) {
  const Scene scene = Generated("planes", 600);
  View view;
  view.camera = scene.cameras.at(0);
  view.width = view.height = 40;
  const Environment sky = Sky("studio");
  ReferenceOptions options = Options(2, 256);
  const ReferenceResult joint = Trace(scene, sky, view, options);
  options.environment_sampling = false;
  options.seed = 2;
  const ReferenceResult alone = Trace(scene, sky, view, options);
  // Mean difference against its own standard error, estimated from the halves.
  double difference = 0, variance = 0, mean = 0;
  for (size_t i = 0; i < joint.picture.pixels.size(); ++i) {
    const auto mono = [](const glm::vec4& p) { return (p.x + p.y + p.z) / 3.0; };
    difference += mono(joint.picture.pixels[i]) - mono(alone.picture.pixels[i]);
    mean += mono(joint.picture.pixels[i]);
    variance += std::pow(mono(joint.half_difference.pixels[i]), 2) +
                std::pow(mono(alone.half_difference.pixels[i]), 2);
  }
  EXPECT_GT(mean, 0);
  EXPECT_LT(std::abs(difference), 4 * std::sqrt(variance));
  EXPECT_LT(std::sqrt(variance), 0.02 * mean);
}

TEST(ReferenceTest, NoiseEstimatePredictsTheDifferenceOfTwoSeeds) {
  const Scene scene = Generated("planes", 600);
  View view;
  view.camera = scene.cameras.at(0);
  view.width = view.height = 40;
  ReferenceOptions options = Options(1, 256);
  const ReferenceResult a = Trace(scene, Sky("studio"), view, options);
  options.seed = 99;
  const ReferenceResult b = Trace(scene, Sky("studio"), view, options);
  const double epsilon =
      0.1 * (MeanCovered(b.picture).x + MeanCovered(b.picture).y + MeanCovered(b.picture).z) / 3;
  double sum = 0;
  int count = 0;
  for (size_t i = 0; i < a.picture.pixels.size(); ++i) {
    const glm::vec4 p = a.picture.pixels[i], q = b.picture.pixels[i];
    if (p.w < 1 || q.w < 1) continue;
    for (int c = 0; c < 3; ++c) sum += std::pow(p[c] - q[c], 2) / (std::pow(q[c], 2) + epsilon * epsilon) / 3;
    ++count;
  }
  const double measured = sum / count, predicted = a.noise_rel_mse + b.noise_rel_mse;
  EXPECT_GT(measured, 0.6 * predicted);
  EXPECT_LT(measured, 1.6 * predicted);
  EXPECT_LT(a.noise_block4_rel_mse, 0.3 * a.noise_rel_mse);
}

TEST(ReferenceTest, SameBytesForAnyNumberOfThreads) {
  const Scene scene = Generated("planes", 600);
  const RayScene rays(scene);
  View view;
  view.camera = scene.cameras.at(0);
  view.width = 50;
  view.height = 37;
  const Environment sky = Sky("sunset");
  std::optional<Picture> first;
  for (const int threads : {1, 2, 3}) {
    ReferenceOptions options = Options(2, 8);
    options.threads = threads;
    Result<ReferenceResult> result = RenderReference(scene, rays, nullptr, sky, view, options);
    ASSERT_TRUE(result.ok());
    if (!first) first = result->picture;
    EXPECT_EQ(std::memcmp(first->pixels.data(), result->picture.pixels.data(),
                          first->pixels.size() * sizeof(glm::vec4)),
              0);
  }
}

TEST(ReferenceTest, SidesOfASurface) {
  const Environment sky = Sky("uniform");
  const View above = ViewOf({0, 3, 1}, {0, 0, 0}, 0.2f, 8), below = ViewOf({0, -3, 1}, {0, 0, 0}, 0.2f, 8);
  Scene scene = Square(Lambert(0.5f));
  EXPECT_NEAR(MeanCovered(Trace(scene, sky, above, Options(0, 64)).picture).x, 0.5, 0.002);
  EXPECT_EQ(MeanCovered(Trace(scene, sky, below, Options(0, 64)).picture).x, 0);
  scene.materials[0].double_sided = true;
  EXPECT_NEAR(MeanCovered(Trace(scene, sky, below, Options(0, 64)).picture).x, 0.5, 0.002);
}

// A lid whose back side is black still blocks the light of the floor under it.
TEST(ReferenceTest, BackSidesBlockLight) {
  Scene scene = Square(Lambert(0.5f));
  for (int i = 0; i < 4; ++i) {
    scene.positions.push_back(scene.positions[static_cast<size_t>(i)] * 1000.0f + glm::vec3(0, 0.5f, 0));
    scene.normals.emplace_back(0, 1, 0);
    scene.uvs.emplace_back(0);
    scene.colors.emplace_back(1);
    scene.vertex_material.push_back(0);
  }
  scene.triangles.push_back({4, 5, 6});
  scene.triangles.push_back({4, 6, 7});
  scene.triangle_material.assign(4, 0);
  const ReferenceResult result =
      Trace(scene, Sky("uniform"), ViewOf({0, 0.3f, 0.6f}, {0, 0, 0}, 0.4f, 8), Options(2, 64));
  EXPECT_LT(MeanCovered(result.picture).x, 0.002);  // only what comes from 1000 away along the horizon
}

TEST(ReferenceTest, BackgroundShowsTheTurnedEnvironmentWithoutCoverage) {
  const Scene scene = Square(Lambert(0.5f));
  View view = ViewOf({0, 5, 0}, {0, 5, -1}, 1e-4f, 2);
  view.background = Background::kEnvironment;
  view.environment_rotation_deg = 40;
  const Environment sky = Sky("sunset");
  const ReferenceResult result = Trace(scene, sky, view, Options(0, 16));
  const glm::vec3 expected = sky.Radiance(RotateForLookup({0, 0, -1}, 40));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(result.picture.at(1, 1)[c] / expected[c], 1, 1e-3f);
  EXPECT_EQ(result.picture.at(1, 1).w, 0);
}

TEST(ReferenceTest, RefusesOptionsOutOfRange) {
  const Scene scene = Square(Lambert(0.5f));
  const RayScene rays(scene);
  const Environment sky = Sky("uniform");
  const auto kind = [&](const View& view, const ReferenceOptions& options) {
    return RenderReference(scene, rays, nullptr, sky, view, options).status().kind();
  };
  const View view = ViewOf({0, 3, 1}, {0, 0, 0}, 0.2f, 4);
  EXPECT_EQ(kind(view, Options(0, 3)), ErrorKind::kUsage);
  EXPECT_EQ(kind(view, Options(0, 0)), ErrorKind::kUsage);
  EXPECT_EQ(kind(view, Options(-1, 4)), ErrorKind::kUsage);
  ReferenceOptions late = Options(1, 4);
  late.first_bounce = 2;
  EXPECT_EQ(kind(view, late), ErrorKind::kUsage);
  View empty = view;
  empty.width = 0;
  EXPECT_EQ(kind(empty, Options(0, 4)), ErrorKind::kUsage);
  View far = view;
  far.camera.eye.x = 1e19f;
  EXPECT_EQ(kind(far, Options(0, 4)), ErrorKind::kUsage);
  ReferenceOptions lobes = Options(0, 4);
  lobes.lobes = true;
  EXPECT_EQ(kind(view, lobes), ErrorKind::kInternal);
}

}  // namespace
}  // namespace glint
