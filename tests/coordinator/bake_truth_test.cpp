// Whole bakes against what is known: closed forms, and the path tracer.

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "common/archive/lobe_codec.h"
#include "common/base/frame.h"
#include "common/render/archive_renderer.h"
#include "common/render/reference.h"
#include "tests/coordinator/bake_fixture.h"
#include "tests/coordinator/baked.h"

namespace glint {
namespace {

using bake_fixture::BakeHere;
using bake_fixture::Generated;
using bake_fixture::SmallOptions;

class BakeTruthTest : public testing::TestWithParam<GatherMethod> {};

TEST_P(BakeTruthTest, ASphereAloneStoresNothing) {
  BakeOptions options = SmallOptions(GetParam());
  options.layer_tolerance = 0.01f;
  options.max_layers = 16;
  const auto baked = BakeHere(Generated("sphere", 600), options);
  // The first indirect layer is found to be empty, and no further one is tried.
  ASSERT_EQ(baked->report.layers.size(), 2u);
  EXPECT_EQ(baked->report.layers[0].stored[0], 0u);
  EXPECT_EQ(baked->report.layers[0].energy, 1.0);
  EXPECT_EQ(baked->report.layers[1].stored[0], 0u);
  EXPECT_EQ(baked->report.layers[1].energy, 0.0);
  EXPECT_TRUE(baked->report.complete);
}

TEST_P(BakeTruthTest, NothingReachesTheSkyFromInsideAFurnace) {
  const auto baked = BakeHere(Generated("furnace", 600, 0), SmallOptions(GetParam()));
  const BakeDomain& domain = baked->archive->domain();
  const auto& layers = baked->archive->layers();
  for (uint32_t v = 0; v < domain.vertex_count(); ++v) {
    const std::byte* entry = layers[0].diffuse.Find(v, 0);
    ASSERT_NE(entry, nullptr) << "vertex " << v << " sees the sky";
    EXPECT_EQ(DecodeDirect(entry, layers[0].diffuse.entry_bytes()).fraction, 0.0f) << "vertex " << v;
  }
  for (size_t layer = 1; layer < layers.size(); ++layer) {
    EXPECT_EQ(baked->report.layers[layer].stored[0], 0u);
    EXPECT_EQ(baked->report.layers[layer].energy, 0.0);
  }

  Result<Environment> sky = Environment::Procedural("uniform", 16);
  ASSERT_TRUE(sky.ok());
  const PrefilteredEnvironment prefiltered(*sky, 1);
  ArchiveRenderer renderer(*baked->archive, prefiltered, {});
  View view;
  view.camera = baked->archive->cameras().at(0);
  view.width = view.height = 32;
  Result<Picture> picture = renderer.Render(view);
  ASSERT_TRUE(picture.ok());
  for (const glm::vec4& pixel : picture->pixels) {
    EXPECT_EQ(pixel.w, 1.0f);
    EXPECT_EQ(pixel.x + pixel.y + pixel.z, 0.0f);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, BakeTruthTest, testing::Values(GatherMethod::kShared, GatherMethod::kPaper),
                         [](const auto& m) { return m.param == GatherMethod::kShared ? "Shared" : "Paper"; });

double MeanLuminance(const Picture& picture) {
  double sum = 0;
  for (const glm::vec4& p : picture.pixels) sum += Luminance(glm::vec3(p));
  return sum / static_cast<double>(picture.pixels.size());
}

// Light between two facing metal plates: each reflection alone carries as much as the path tracer finds.
TEST(BakeEnergyTest, FacingPlanesCarryWhatThePathTracerFinds) {
  const Scene scene = Generated("planes", 1000, 0);
  BakeOptions options = SmallOptions();
  options.settings.grid_level = 2;
  options.settings.max_rays = 1024;
  const auto baked = BakeHere(scene, options);
  Result<Environment> sky = Environment::Procedural("uniform", 64);
  ASSERT_TRUE(sky.ok());
  const PrefilteredEnvironment prefiltered(*sky, 1);
  const RayScene rays(scene, 1);
  View view;
  view.camera.eye = {0.2f, 0.8f, 0.8f};  // between them
  view.camera.forward = glm::normalize(glm::vec3(-0.2f, -0.8f, -0.7f));
  view.camera.vertical_fov = 1;
  view.width = 48;
  view.height = 32;
  for (int layer = 0; layer <= 2; ++layer) {
    ArchiveRenderOptions one;
    one.first_layer = one.last_layer = layer;
    one.samples = 2;
    ArchiveRenderer renderer(*baked->archive, prefiltered, one);
    Result<Picture> picture = renderer.Render(view);
    ASSERT_TRUE(picture.ok());
    ReferenceOptions truth_options;
    truth_options.bounces = truth_options.first_bounce = layer;
    truth_options.samples = 128;
    truth_options.lobes = true;
    Result<ReferenceResult> truth =
        RenderReference(scene, rays, &baked->archive->domain(), *sky, view, truth_options);
    ASSERT_TRUE(truth.ok());
    const double mean = MeanLuminance(*picture), expected = MeanLuminance(truth->picture);
    std::printf("  layer %d: mean %.4f, path tracer %.4f (%+.2f %%)\n", layer, mean, expected,
                100 * (mean / expected - 1));
    EXPECT_GT(expected, 0.001);
    EXPECT_NEAR(mean / expected, 1, 0.05);
  }
}

}  // namespace
}  // namespace glint
