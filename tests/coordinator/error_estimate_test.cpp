// What a bake says of its own error: nothing where it has none, each cause where it is starved, and as much
// as relit pictures show.

#include "coordinator/error_estimate.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "common/domain/bare_scene.h"
#include "common/scene/ray_scene.h"
#include "tests/coordinator/bake_fixture.h"
#include "tests/coordinator/baked.h"
#include "tests/coordinator/relit_error.h"

namespace glint {
namespace {

using bake_fixture::BakeHere;
using bake_fixture::Generated;
using bake_fixture::GeneratedPaint;
using bake_fixture::SmallOptions;

ErrorEstimate EstimateOf(const Archive& archive, uint32_t slices, int threads = 2,
                         const ReadOut& read_out = SmallOptions().settings.read_out(),
                         uint64_t seed = BakeSettings().seed) {
  const RayScene rays(BareScene(archive.domain()));
  Result<ErrorEstimate> estimate = EstimateError(archive.domain(), rays, archive.MakeGrid(), archive.layers(),
                                                 {slices, seed, read_out, threads});
  EXPECT_TRUE(estimate.ok()) << estimate.status().message();
  return *estimate;
}

double Part(const ErrorSummary& summary, ErrorCause cause) {
  return summary.cause[static_cast<size_t>(cause)];
}

TEST(ErrorEstimateTest, ASphereAloneHasOnlyItsLobesError) {
  const auto baked = BakeHere(Generated("sphere", 600), SmallOptions());
  const ErrorEstimate estimate = EstimateOf(*baked->archive, 256);
  EXPECT_EQ(estimate.slices, 256u);
  // What the horizon cuts off lobes at grazing views.
  EXPECT_LT(estimate.all.rms, 0.05);
  for (const ErrorCause cause :
       {ErrorCause::kBits, ErrorCause::kAngular, ErrorCause::kSpatial, ErrorCause::kBelow, ErrorCause::kRays})
    EXPECT_EQ(Part(estimate.all, cause), 0.0) << kErrorCauseNames[static_cast<size_t>(cause)];
  ASSERT_EQ(estimate.layers.size(), baked->report.layers.size());
  EXPECT_EQ(estimate.layers[1].rms, 0.0);
}

TEST(ErrorEstimateTest, NothingIsWrongWithADarkFurnace) {
  const auto baked = BakeHere(Generated("furnace", 600, 0), SmallOptions());
  const ErrorEstimate estimate = EstimateOf(*baked->archive, 64);
  EXPECT_EQ(estimate.slices, 64u);
  EXPECT_EQ(estimate.all.rms, 0.0);
  EXPECT_EQ(estimate.all.worst, 0.0);
}

/// A part of the estimate for a bake of these settings, in layers 0 and 1.
double PartOf(ErrorCause cause, uint32_t vertices, int grid_level, int max_rays, float exponent) {
  BakeOptions options = SmallOptions();
  options.settings.grid_level = grid_level;
  options.settings.max_rays = max_rays;
  options.settings.min_rays = std::min(max_rays, options.settings.min_rays);
  options.max_layers = 1;
  const auto baked = BakeHere(Generated("goblets", vertices, exponent), options);
  return Part(EstimateOf(*baked->archive, 1024).all, cause);
}

TEST(ErrorEstimateTest, FewDirectionsAreAnAngularError) {
  const double few = PartOf(ErrorCause::kAngular, 500, 1, 512, 128);
  const double many = PartOf(ErrorCause::kAngular, 500, 3, 512, 128);
  std::printf("  angular: %.4f with 42 directions, %.4f with 642\n", few, many);
  EXPECT_GT(few, 1.5 * many);
}

TEST(ErrorEstimateTest, FewVerticesAreASpatialError) {
  const double few = PartOf(ErrorCause::kSpatial, 500, 2, 256, 32);
  const double many = PartOf(ErrorCause::kSpatial, 4000, 2, 256, 32);
  std::printf("  spatial: %.4f with 500 vertices, %.4f with 4000\n", few, many);
  EXPECT_GT(few, 1.3 * many);
}

TEST(ErrorEstimateTest, FewRaysAreAnErrorOfRays) {
  const double few = PartOf(ErrorCause::kRays, 1000, 2, 32, 32);
  const double many = PartOf(ErrorCause::kRays, 1000, 2, 2048, 32);
  std::printf("  rays: %.4f with 36 a vertex, %.4f with a few hundred\n", few, many);
  EXPECT_GT(few, 2 * many);
}

TEST(ErrorEstimateTest, SeveralLobesTakeAwayAnErrorOfLobes) {
  const auto part = [](int slice_lobes) {
    BakeOptions options = SmallOptions();
    options.settings.slice_lobes = slice_lobes;
    options.max_layers = 1;
    const auto baked = BakeHere(Generated("goblets", 500, 64), options);
    const ErrorEstimate estimate = EstimateOf(*baked->archive, 1024, 2, options.settings.read_out());
    return Part(estimate.layers[1], ErrorCause::kLobes);
  };
  const double one = part(1), four = part(kMaxSliceLobes);
  std::printf("  lobes: %.4f with one, %.4f with up to four\n", one, four);
  EXPECT_LT(four, 0.85 * one);
}

/// Faces are small, so that what a lobe loses under a face is no more than the rest.
TEST(ErrorEstimateTest, SeveralLobesTakeAwayAnErrorOfDirectLight) {
  const Scene scene = Generated("goblets", 10000, 32);
  BakeOptions options = SmallOptions();
  options.settings.min_rays = options.settings.max_rays = 64;
  options.max_layers = 0;
  for (const uint64_t seed : {1, 2, 3}) {
    const auto part = [&](int slice_lobes) {
      options.settings.slice_lobes = slice_lobes;
      options.settings.seed = seed;
      const auto baked = BakeHere(scene, options);
      return Part(EstimateOf(*baked->archive, 3000, 2, options.settings.read_out(), seed).layers[0],
                  ErrorCause::kLobes);
    };
    const double one = part(1), two = part(2);
    std::printf("  lobes: %.4f with one, %.4f with up to two\n", one, two);
    EXPECT_LT(two, 0.9 * one) << seed;
  }
}

TEST(ErrorEstimateTest, AnyNumberOfThreadsFindsTheSame) {
  for (const Scene& scene : {Generated("goblets", 500), GeneratedPaint("knot", 500)}) {
    BakeOptions options = SmallOptions();
    options.estimate_slices = 48;
    const auto baked = BakeHere(scene, options);
    ASSERT_TRUE(baked->report.error);
    // The archive's geometry stands in for the scene's.
    const std::string one = ToJson(EstimateOf(*baked->archive, 48, 1));
    EXPECT_EQ(one, ToJson(EstimateOf(*baked->archive, 48, 3)));
    EXPECT_EQ(one, ToJson(*baked->report.error));
  }
}

TEST(ErrorEstimateTest, TheReportInTheArchiveHasIt) {
  BakeOptions options = SmallOptions();
  const Scene scene = Generated("planes", 500);
  options.estimate_slices = 8;
  const auto with = BakeHere(scene, options);
  options.estimate_slices = 0;
  const auto without = BakeHere(scene, options);
  const auto report = nlohmann::json::parse(with->archive->report_json());
  ASSERT_TRUE(report.contains("error"));
  EXPECT_EQ(report["error"]["slices"], 8);
  EXPECT_EQ(report["error"]["layers"].size(), with->report.layers.size());
  EXPECT_TRUE(report["error"]["all"]["causes"].contains("spatial"));
  EXPECT_FALSE(nlohmann::json::parse(without->archive->report_json()).contains("error"));
  EXPECT_FALSE(without->report.error);
  // Other bytes, another key.
  EXPECT_NE(with->archive->archive_key(), without->archive->archive_key());
}

TEST(EstimatePicturesTest, TheEstimateIsWithinAFactorOfTwoOfPictures) {
  BakeOptions options = SmallOptions();
  options.settings.grid_level = 2;
  const Scene scene = Generated("goblets", 800);
  const auto baked = BakeHere(scene, options);
  const ErrorEstimate estimate = EstimateOf(*baked->archive, 2048);
  for (const char* name : {"studio", "sunset"}) {
    const Result<Environment> sky = Environment::Procedural(name, 128);
    ASSERT_TRUE(sky.ok());
    const Result<double> error = RelitError(scene, *baked->archive, *sky, {8, 40, 64, 2});
    ASSERT_TRUE(error.ok()) << error.status().message();
    std::printf("  %s: estimate %.4f +- %.4f, pictures %.4f\n", name, estimate.all.rms,
                estimate.all.uncertainty, *error);
    EXPECT_GT(estimate.all.rms, 0.5 * *error);
    EXPECT_LT(estimate.all.rms, 2 * *error);
  }
}

}  // namespace
}  // namespace glint
