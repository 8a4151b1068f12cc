#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "common/base/status.h"
#include "common/render/image.h"

namespace glint {

/// Distant radiance, equirectangular. For a unit direction d (y up): u = 0.5 + atan2(d.z, d.x) / (2 pi), left to right;
/// v = 0.5 - asin(d.y) / pi, top to bottom; texel centres at (i + 0.5) / W; bilinear, wrapping in u, clamped in v.
/// Turned by r degrees about +Y: look up R_Y(-r) d.
class Environment {
 public:
  /// Takes the picture's RGB; refuses non-finite or negative values are clamped to 0 with a count in `clamped`.
  static Result<Environment> FromPicture(const Picture& picture, const std::string& name);
  static Result<Environment> Load(const std::filesystem::path& path);
  /// Own procedural skies: "studio" (soft boxes), "sunset" (small sun, horizon gradient), "uniform" (radiance 1).
  static Result<Environment> Procedural(const std::string& name, int width = 512);
  /// `procedural:NAME` or a path.
  static Result<Environment> Open(const std::string& path_or_name);

  int width() const { return width_; }
  int height() const { return height_; }
  const std::vector<glm::vec3>& texels() const { return texels_; }
  /// Bilinear radiance; d unit.
  glm::vec3 Radiance(const glm::vec3& d) const;
  /// Direction of texel co-ordinates (u, v) in [0, 1]^2.
  static glm::vec3 Direction(float u, float v);
  static glm::vec2 Coordinates(const glm::vec3& d);

  /// Importance sampling by texel luminance x solid angle (piecewise constant within a texel's footprint).
  struct Sample {
    glm::vec3 direction;
    float pdf;  ///< 1/sr
  };
  Sample SampleDirection(float u, float v) const;
  float Pdf(const glm::vec3& d) const;

 private:
  int width_ = 0, height_ = 0;
  std::vector<glm::vec3> texels_;
  std::vector<float> row_cdf_, column_cdf_;
  double total_ = 0;
};

/// d turned by -degrees about +Y: the direction to look up for an environment turned by `degrees`.
glm::vec3 RotateForLookup(const glm::vec3& d, float degrees);

}  // namespace glint
