#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/render/reference.h"

namespace glint {

/// One picture of an outside path tracer and what is known about it.
struct OutsidePicture {
  std::filesystem::path file;
  int bounces = 0;
  double noise_block4_rel_mse = 0;    ///< of the picture itself, after 4 x 4 averaging
  std::filesystem::path cycles_file;  ///< the same view by Cycles; empty if there is none
  double cycles_fresnel_bias = 0;     ///< (exact - Cycles' Fresnel curve) / exact, of the mean
};

/// A view that outside path tracers have rendered.
struct OutsideView {
  std::string name;
  std::filesystem::path scene, environment, mask;
  Camera camera;
  int width = 0, height = 0;
  std::vector<OutsidePicture> pictures;
};

/// Folder of the outside references: $GLINT_SHARED_DATA, or ../shared/data of the source tree; nothing if
/// absent.
std::optional<std::filesystem::path> FindSharedData();

/// Reads ref/<scene>/scene.json: the views whose pictures are there.
Result<std::vector<OutsideView>> LoadOutsideViews(const std::filesystem::path& shared_data,
                                                  const std::string& scene);

/// How far a picture is from an outside one. Both are averaged over blocks that cover 4 x 4 outside pixels; a
/// block counts if the mask has all of its pixels.
struct Agreement {
  double rel_mse = 0;  ///< mean (t - r)^2 / (r^2 + eps^2), eps = 0.1 mean(r)
  double noise =
      0;  ///< part of rel_mse that the test's own noise makes, by its halves, with the same denominators
  double bias_error = 0;  ///< standard error of `bias` from the test's own noise, by its halves
  double bias = 0;        ///< mean(t) / mean(r) - 1
  size_t blocks = 0;
};

/// @param test  the view at 1, 1/2 or 1/4 of the outside picture's size
Result<Agreement> CompareWithOutside(const ReferenceResult& test, const std::filesystem::path& outside,
                                     const std::filesystem::path& mask);

}  // namespace glint
