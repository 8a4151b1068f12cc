#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "common/scene/load.h"
#include "tests/render/outside_references.h"

namespace glint {
namespace {

constexpr int kFactor = 4;  // a quarter of the outside pictures' size: one pixel is one block of theirs
constexpr int kSamples = 64;

/// Against the exact tracer: the difference is noise. In 16 pictures (64 and 128 samples) it was 0.96 to 1.09
/// times what the halves predict; 2 leaves room for the long tails of sun reflections. The means agree within
/// 0.2 % and four of our own standard errors.
void ExpectExactAgreement(const Agreement& agreement, const OutsidePicture& picture) {
  const double noise = agreement.noise + picture.noise_block4_rel_mse;
  EXPECT_GT(agreement.blocks, 5000u);
  EXPECT_LT(agreement.rel_mse, 2 * noise) << picture.file;
  EXPECT_NEAR(agreement.bias, 0, 0.002 + 4 * agreement.bias_error) << picture.file;
}

/// Cycles' means are lower or higher by its Fresnel curve, which scene.json states.
void ExpectCyclesAgreement(const ReferenceResult& result, const OutsidePicture& picture,
                           const OutsideView& view) {
  if (picture.cycles_file.empty()) return;
  Result<Agreement> agreement = CompareWithOutside(result, picture.cycles_file, view.mask);
  ASSERT_TRUE(agreement.ok()) << agreement.status().message();
  EXPECT_NEAR(agreement->bias, picture.cycles_fresnel_bias, 0.003 + 4 * agreement->bias_error)
      << picture.cycles_file;
}

void CheckView(const OutsideView& outside) {
  Result<Scene> scene = LoadScene(outside.scene);
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  Result<Environment> sky = Environment::Load(outside.environment);
  ASSERT_TRUE(sky.ok()) << sky.status().message();
  const RayScene rays(*scene);
  View view;
  view.camera = outside.camera;
  view.width = outside.width / kFactor;
  view.height = outside.height / kFactor;
  for (const OutsidePicture& picture : outside.pictures) {
    ReferenceOptions options;
    options.bounces = picture.bounces;
    options.samples = kSamples;
    Result<ReferenceResult> result = RenderReference(*scene, rays, nullptr, *sky, view, options);
    ASSERT_TRUE(result.ok()) << result.status().message();
    Result<Agreement> agreement = CompareWithOutside(*result, picture.file, outside.mask);
    ASSERT_TRUE(agreement.ok()) << agreement.status().message();
    std::printf("  b%-2d relMSE %.2e, noise %.2e + %.2e, bias %+.3f%% +- %.3f%%\n", picture.bounces,
                agreement->rel_mse, agreement->noise, picture.noise_block4_rel_mse, 100 * agreement->bias,
                100 * agreement->bias_error);
    ExpectExactAgreement(*agreement, picture);
    ExpectCyclesAgreement(*result, picture, outside);
  }
}

void CheckScene(const std::string& scene) {
  const auto data = FindSharedData();
  if (!data) {
    std::printf("  note: no outside references here (GLINT_SHARED_DATA); nothing to compare with\n");
    return;
  }
  Result<std::vector<OutsideView>> views = LoadOutsideViews(*data, scene);
  ASSERT_TRUE(views.ok()) << views.status().message();
  EXPECT_FALSE(views->empty());
  for (const OutsideView& view : *views) CheckView(view);
}

TEST(ReferenceAgreementTest, TeapotMatchesOutsidePathTracers) { CheckScene("teapot_plane"); }
TEST(ReferenceAgreementTest, GobletsMatchOutsidePathTracers) { CheckScene("goblets"); }

}  // namespace
}  // namespace glint
