// Reflectances from mirror to matt, and views along the surface.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"
#include "common/lobes/slice_sampler.h"
#include "common/render/archive_renderer.h"
#include "common/render/reference.h"
#include "tests/stability/stability_fixture.h"

namespace glint::stability {
namespace {

/// A hollow box of size 1, fronts inwards, without a ceiling.
Scene OpenBox(const Material& material) {
  MeshBuilder builder;
  AddBox({0, 0, 0}, {1, 1, 1}, 5, true, builder.AddMaterial(material), &builder);
  Scene scene = builder.Finish(AnyCamera());
  std::vector<std::array<uint32_t, 3>> kept;
  for (const auto& t : scene.triangles)
    if (scene.positions[t[0]].y + scene.positions[t[1]].y + scene.positions[t[2]].y < 2.9f) kept.push_back(t);
  scene.triangles = kept;
  scene.triangle_material.resize(kept.size());
  scene.content = HashScene(scene);
  return scene;
}

/// Looks down into it.
View IntoTheBox() {
  View view;
  view.camera.eye = {0.8f, 1.5f, 0.9f};
  view.camera.forward = glm::normalize(glm::vec3(-0.4f, -1.2f, -0.5f));
  view.camera.vertical_fov = 0.5f;
  view.width = view.height = 20;
  return view;
}

double Mean(const Picture& picture) {
  double sum = 0;
  for (const glm::vec4& p : picture.pixels) sum += Luminance(glm::vec3(p));
  return sum / static_cast<double>(picture.pixels.size());
}

class MaterialTest : public testing::TestWithParam<GatherMethod> {
 protected:
  void SetUp() override { sky_ = *Environment::Procedural("uniform", 16); }

  /// Relative error of a picture's mean under a uniform sky, from paths through the same lobes.
  double ErrorOfLight(const Baked& baked, const PrefilteredEnvironment& sky) const {
    ArchiveRenderOptions all;
    all.threads = 1;
    ArchiveRenderer renderer(baked.archive(), sky, all);
    const View view = IntoTheBox();
    const Result<Picture> picture = renderer.Render(view);
    ReferenceOptions options;
    options.bounces = baked.layers() - 1;
    options.samples = 64;
    options.lobes = true;
    options.threads = 1;
    const RayScene rays(baked.scene());
    const Result<ReferenceResult> truth =
        RenderReference(baked.scene(), rays, &baked.domain(), sky_, view, options);
    EXPECT_TRUE(picture.ok() && truth.ok());
    return std::abs(Mean(*picture) / Mean(truth->picture) - 1);
  }

  Environment sky_;
};

TEST_P(MaterialTest, LayersCarryWhatPathsCarryAtAnyRoughness) {
  const PrefilteredEnvironment sky(sky_, 1);
  for (const float roughness : {0.02f, 0.25f, 0.5f, 1.0f}) {
    const Baked baked(OpenBox(Metal(roughness, glm::vec3(0.9f))),
                      {.method = GetParam(), .layers = 3, .max_rays = 2048});
    ExpectAtMost("open box, roughness " + Short(roughness) + ", " + NameOf(GetParam()) +
                     ": relative error of the light",
                 ErrorOfLight(baked, sky), 0.1);
  }
}

// What mirrors do not lose must come out: all reflections add up to the sky.
TEST_P(MaterialTest, MirrorsInAnOpenBoxGiveBackWhatTheyGet) {
  const PrefilteredEnvironment sky(sky_, 1);
  for (const float roughness : {0.0f, 0.02f}) {
    const Baked baked(OpenBox(Metal(roughness)),
                      {.method = GetParam(), .layers = 12, .rays = 256, .max_rays = 1024});
    ArchiveRenderOptions all;
    all.threads = 1;
    ArchiveRenderer renderer(baked.archive(), sky, all);
    const Result<Picture> picture = renderer.Render(IntoTheBox());
    ASSERT_TRUE(picture.ok());
    double covered = 0;
    for (const glm::vec4& p : picture->pixels) covered += p.w;
    ExpectAtMost("mirrors of roughness " + Short(roughness) + ": sum of 13 reflections, " +
                     NameOf(GetParam()) + ", from 1",
                 std::abs(Mean(*picture) * static_cast<double>(picture->pixels.size()) / covered - 1), 0.02);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, MaterialTest, testing::Values(GatherMethod::kShared, GatherMethod::kPaper),
                         [](const auto& m) { return m.param == GatherMethod::kShared ? "Shared" : "Paper"; });

// A lone floor, seen from everywhere down to along it.
TEST(GrazingTest, AViewAlongTheSurfaceReflectsNoMoreThanThereIs) {
  for (const float roughness : {0.0f, 0.02f, 0.3f, 1.0f}) {
    MeshBuilder builder;
    builder.AddPatch({0, 0, 0}, {1, 0, 0}, {0, 0, -1}, 2, 2, builder.AddMaterial(Metal(roughness)));
    const Baked baked(builder.Finish(AnyCamera()), {.layers = 0});
    double most = 0, least = 1;
    for (const float cosine : {1.0f, 0.5f, 0.1f, 1e-2f, 1e-3f, 1e-4f, 1e-6f, 1e-10f, 0.0f}) {
      const float s = std::sqrt((1 - cosine) * (1 + cosine));
      for (int i = 0; i < 16; ++i) {
        const glm::vec3 wo(s * std::cos(0.4f * i), cosine, s * std::sin(0.4f * i));
        const double reflected = baked.Reflected(0, 0.3f, 0.3f, wo, 0).x;
        most = std::max(most, reflected);
        least = std::min(least, reflected);
      }
    }
    ExpectAtMost("grazing views, roughness " + Short(roughness) + ": reflected beyond 1",
                 std::max(0.0, most - 1), 0.01);
    EXPECT_GT(least, 0);
  }
}

// Whatever the reflectance and the view: finite, no more than comes in, no lobe sharper than can be held.
RC_GTEST_PROP(MaterialPropertyTest, SlicesReflectNoMoreThanTheyGet, ()) {
  Brdf brdf;
  brdf.model = *rc::gen::element(BrdfModel::kGgx, BrdfModel::kPhong, BrdfModel::kBlinnPhong);
  const float u = static_cast<float>(*rc::gen::inRange(0, 1001)) / 1000;
  brdf.shape = brdf.model == BrdfModel::kGgx ? std::max(u, kMinRoughness) : std::pow(10.0f, 6 * u) - 1;
  const SliceSampler sampler(FitBrdfShape(brdf.model, brdf.shape, {.max_lobes = 2}));
  for (int i = 0; i <= 64; ++i) {
    const float cosine = std::pow(static_cast<float>(i) / 64, 4.0f);
    const BrdfSlice slice = sampler.Seen(cosine);
    float sum = 0;
    for (int k = 0; k < slice.lobes; ++k) {
      const BrdfLobe& lobe = slice.lobe[k];
      sum += lobe.Weight(glm::vec3(1)).x;
      RC_ASSERT(std::isfinite(lobe.mu_x + lobe.mu_z) && lobe.kappa >= 0 && lobe.kappa <= 2 * kMaxKappa);
    }
    RC_LOG() << "cosine " << cosine << " sum " << sum << std::endl;
    RC_ASSERT(sum >= 0 && sum <= 1.01f);
  }
}

}  // namespace
}  // namespace glint::stability
