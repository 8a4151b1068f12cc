#include "common/render/archive_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/archive/lobe_codec.h"
#include "common/render/reference.h"
#include "common/scene/bounds.h"
#include "common/scene/generate.h"

namespace glint {
namespace {

constexpr int kGridLevel = 1;

Environment Sky(const std::string& name, int width = 256) {
  Result<Environment> sky = Environment::Procedural(name, width);
  EXPECT_TRUE(sky.ok()) << sky.status().message();
  return std::move(sky).value();
}

/// A sphere, its domain, and layers whose every slice is the same, or absent.
class ArchiveRendererTest : public ::testing::Test {
 protected:
  void UseSphere(const Material& material) {
    GenerateOptions options;
    options.vertices = 4000;
    Result<Scene> scene = GenerateScene("sphere", options);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    scene_ = std::move(scene).value();
    for (Material& m : scene_.materials) m = material;
    domain_ = BuildBakeDomain(scene_, {}, 1);
    view_.camera = scene_.cameras.at(0);
    view_.width = view_.height = 64;
  }

  static Material Metal(float roughness) {
    Material material;
    material.base_color = {0.9f, 0.6f, 0.3f};
    material.roughness = roughness;
    return material;
  }
  static Material Matt() {
    Material material;
    material.model = MaterialModel::kPhong;
    material.diffuse = {0.8f, 0.5f, 0.2f};
    return material;
  }

  /// Table with `entry` in every cell, or in none if it is empty.
  SliceTableView Table(uint32_t columns, uint32_t entry_bytes, const std::vector<std::byte>& entry) {
    SliceTableBuilder builder(domain_.vertex_count(), columns, entry_bytes);
    std::vector<uint16_t> all(columns);
    std::iota(all.begin(), all.end(), uint16_t{0});
    std::vector<std::byte> row;
    for (uint32_t i = 0; i < columns; ++i) row.insert(row.end(), entry.begin(), entry.end());
    if (!entry.empty()) {
      for (uint32_t v = 0; v < domain_.vertex_count(); ++v) builder.AppendRow(all, row);
    }
    bytes_.push_back(std::make_unique<std::vector<std::byte>>(builder.Finish(TableForm::kCompact)));
    Result<SliceTableView> table = SliceTableView::Parse(*bytes_.back());
    EXPECT_TRUE(table.ok()) << table.status().message();
    return table.value();
  }
  void AddLayer(uint32_t entry_bytes, const std::vector<std::byte>& entry) {
    LayerViews layer;
    const DirectionGrid grid(kGridLevel);
    for (int k = 0; k < std::max(domain_.max_lobes(), 1); ++k) {
      layer.specular.push_back(Table(grid.size(), entry_bytes, entry));
    }
    layer.diffuse = Table(2, entry_bytes, entry);
    layers_.push_back(layer);
  }
  void AddDirectLayer(const std::optional<DirectLobe>& lobe) {
    std::vector<std::byte> entry(lobe ? kDirectEntryBytes : 0);
    if (lobe) EncodeDirect(*lobe, entry.data());
    AddLayer(kDirectEntryBytes, entry);
  }
  void AddIndirectLayer(const IndirectLobe& lobe) {
    std::vector<std::byte> entry(kIndirectEntryBytes);
    EncodeIndirect(lobe, entry.data());
    AddLayer(kIndirectEntryBytes, entry);
  }

  Picture Render(const Environment& sky, const ArchiveRenderOptions& options = {}) {
    const PrefilteredEnvironment prefiltered(sky, 1);
    ArchiveRenderer renderer(domain_, DirectionGrid(kGridLevel), layers_, prefiltered, options);
    Result<Picture> picture = renderer.Render(view_);
    EXPECT_TRUE(picture.ok()) << picture.status().message();
    return std::move(picture).value();
  }
  ReferenceResult Reference(const Environment& sky, int samples) {
    ReferenceOptions options;
    options.bounces = 0;
    options.samples = samples;
    options.lobes = true;
    const RayScene rays(scene_);
    Result<ReferenceResult> result = RenderReference(scene_, rays, &domain_, sky, view_, options);
    EXPECT_TRUE(result.ok()) << result.status().message();
    return std::move(result).value();
  }

  /// relMSE and relative difference of the means over pixels with normal . wo > min_cos.
  std::pair<double, double> Difference(const Picture& test, const ReferenceResult& truth,
                                       float min_cos) const {
    const PrimaryRays primary(view_);
    double sum_test = 0, sum_truth = 0, square = 0;
    std::vector<std::pair<glm::vec4, glm::vec4>> counted;
    for (int y = 0; y < view_.height; ++y) {
      for (int x = 0; x < view_.width; ++x) {
        const glm::vec3 d = primary.Direction(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
        const float b = glm::dot(d, primary.eye());
        const float inside = b * b - glm::dot(primary.eye(), primary.eye()) + 1;  // sphere of radius 1
        if (inside < min_cos * min_cos) continue;
        counted.emplace_back(test.at(x, y), truth.picture.at(x, y));
        for (int c = 0; c < 3; ++c) sum_test += test.at(x, y)[c], sum_truth += truth.picture.at(x, y)[c];
      }
    }
    EXPECT_GT(counted.size(), 500u);
    const double mean = sum_truth / static_cast<double>(3 * counted.size());
    for (const auto& [t, r] : counted) {
      for (int c = 0; c < 3; ++c) square += std::pow(t[c] - r[c], 2) / (r[c] * r[c] + 0.01 * mean * mean);
    }
    return {square / static_cast<double>(3 * counted.size()), sum_test / sum_truth - 1};
  }

  Scene scene_;
  BakeDomain domain_;
  View view_;
  std::vector<LayerViews> layers_;
  std::vector<std::unique_ptr<std::vector<std::byte>>> bytes_;
};

// Nothing blocks a sphere alone, so a table without slices must give what the path tracer finds with the same
// lobes: the turned environment, the BRDF table and the filtered look-ups are all in this.
TEST_F(ArchiveRendererTest, SphereWithoutSlicesMatchesTracedLobes) {
  const Environment sky = Sky("studio");
  for (const float roughness : {0.2f, 0.5f}) {
    layers_.clear();
    UseSphere(Metal(roughness));
    AddDirectLayer(std::nullopt);
    for (const float rotation : {0.0f, 110.0f}) {
      view_.environment_rotation_deg = rotation;
      const ReferenceResult truth = Reference(sky, 256);
      const Picture picture = Render(sky, {.samples = 4});
      const std::string what =
          "roughness " + std::to_string(roughness) + ", turned " + std::to_string(rotation);
      // Noise of the truth, interpolation between the filter's widths, and what the horizon cuts: the tracer
      // cuts lobes there, and the look-up takes a whole lobe in the cut one's place. Sharp lobes hardly feel
      // that; of broad ones it was measured to move the mean by up to 4 %.
      const bool sharp = roughness < 0.3f;
      const auto [rel_mse, bias] = Difference(picture, truth, 0.3f);
      EXPECT_LT(rel_mse, truth.noise_rel_mse + (sharp ? 0.04 * 0.04 : 0.08 * 0.08)) << what;
      EXPECT_NEAR(bias, 0, sharp ? 0.015 : 0.05) << what;
    }
  }
}

TEST_F(ArchiveRendererTest, MattSphereWithoutSlicesIsExactIrradiance) {
  UseSphere(Matt());
  AddDirectLayer(std::nullopt);
  const Environment sky = Sky("sunset");
  const ReferenceResult truth = Reference(sky, 256);
  const auto [rel_mse, bias] = Difference(Render(sky, {.samples = 4}), truth, 0.3f);
  EXPECT_LT(rel_mse, truth.noise_rel_mse + 0.02 * 0.02);
  EXPECT_NEAR(bias, 0, 0.01);
}

TEST_F(ArchiveRendererTest, BlockedSlicesAreBlackAndFractionsScale) {
  UseSphere(Metal(0.4f));
  const Environment sky = Sky("uniform", 64);
  AddDirectLayer(std::nullopt);
  const Picture free = Render(sky);
  layers_.clear();
  AddDirectLayer(DirectLobe{.fraction = 0.25f});
  const Picture quarter = Render(sky);
  layers_.clear();
  AddDirectLayer(DirectLobe{.fraction = 0});
  const Picture blocked = Render(sky);
  const glm::vec4 p = free.at(32, 32), q = quarter.at(32, 32);
  EXPECT_GT(p.x, 0.5f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(q[c] / p[c], 0.25f, 1e-3f);
  EXPECT_EQ(blocked.at(32, 32), glm::vec4(0, 0, 0, 1));
  EXPECT_EQ(free.at(0, 0), glm::vec4(0));
}

TEST_F(ArchiveRendererTest, LayersAddUpAndCanBeChosen) {
  UseSphere(Metal(0.4f));
  const Environment sky = Sky("uniform", 64);
  AddDirectLayer(std::nullopt);
  AddIndirectLayer({.alpha = {0.5f, 0.25f, 0.125f}, .mu = {0, 1, 0}, .kappa = 3});
  const glm::vec4 direct = Render(sky, {.last_layer = 0}).at(32, 32);
  const glm::vec4 indirect = Render(sky, {.first_layer = 1}).at(32, 32);
  const glm::vec4 both = Render(sky).at(32, 32);
  const float share[3] = {0.5f, 0.25f, 0.125f};
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(both[c], direct[c] + indirect[c], 1e-5f);
    EXPECT_NEAR(indirect[c] / direct[c], share[c], 2e-3f * share[c]);
  }
}

TEST_F(ArchiveRendererTest, MattIndirectLayerIsItsAlbedoTimesTheStoredLight) {
  UseSphere(Matt());
  const Environment sky = Sky("uniform", 64);
  AddDirectLayer(DirectLobe{.fraction = 0});
  AddIndirectLayer({.alpha = glm::vec3(0.5f), .mu = {0, 1, 0}, .kappa = 3});
  const glm::vec4 p = Render(sky).at(32, 32);
  EXPECT_NEAR(p.x, 0.4f, 1e-3f);
  EXPECT_NEAR(p.y, 0.25f, 1e-3f);
  EXPECT_NEAR(p.z, 0.1f, 1e-3f);
}

TEST_F(ArchiveRendererTest, SameBytesForAnyNumberOfThreads) {
  UseSphere(Metal(0.4f));
  AddDirectLayer(std::nullopt);
  view_.width = 61;
  view_.height = 43;
  const Environment sky = Sky("studio");
  const Picture one = Render(sky, {.samples = 3, .threads = 1}),
                three = Render(sky, {.samples = 3, .threads = 3});
  EXPECT_EQ(std::memcmp(one.pixels.data(), three.pixels.data(), one.pixels.size() * sizeof(glm::vec4)), 0);
}

TEST_F(ArchiveRendererTest, BackgroundShowsTheTurnedEnvironmentWithoutCoverage) {
  UseSphere(Metal(0.4f));
  AddDirectLayer(std::nullopt);
  view_.background = Background::kEnvironment;
  view_.environment_rotation_deg = 70;
  const Environment sky = Sky("sunset");
  const glm::vec3 d = PrimaryRays(view_).Direction(0.5f, 0.5f);
  const glm::vec3 expected = sky.Radiance(RotateForLookup(d, 70));
  const glm::vec4 p = Render(sky).at(0, 0);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(p[c], expected[c], 1e-4f * (1 + expected[c]));
  EXPECT_EQ(p.w, 0);
}

TEST_F(ArchiveRendererTest, RefusesSizesAndSamplesOutOfRange) {
  UseSphere(Matt());
  AddDirectLayer(std::nullopt);
  const PrefilteredEnvironment sky(Sky("uniform", 64), 1);
  ArchiveRenderer none(domain_, DirectionGrid(kGridLevel), layers_, sky, {.samples = 0});
  EXPECT_EQ(none.Render(view_).status().kind(), ErrorKind::kUsage);
  ArchiveRenderer renderer(domain_, DirectionGrid(kGridLevel), layers_, sky, {});
  view_.height = 0;
  EXPECT_EQ(renderer.Render(view_).status().kind(), ErrorKind::kUsage);
}

TEST_F(ArchiveRendererTest, FarCamerasAreRefusedBeforeTheRayTracerStopsTheProcess) {
  UseSphere(Matt());
  AddDirectLayer(std::nullopt);
  const PrefilteredEnvironment sky(Sky("uniform", 64), 1);
  ArchiveRenderer renderer(domain_, DirectionGrid(kGridLevel), layers_, sky, {});
  view_.camera.eye = {kMaxEye, -kMaxEye, kMaxEye};
  EXPECT_TRUE(renderer.Render(view_).ok());
  view_.camera.eye = {1e19f, 0, 0};
  EXPECT_EQ(renderer.Render(view_).status().kind(), ErrorKind::kUsage);
}

}  // namespace
}  // namespace glint
