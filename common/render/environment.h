#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/render/image.h"

namespace glint {

/// Distant radiance, equirectangular. For a unit direction d (y up): u = 0.5 + atan2(d.z, d.x) / (2 pi), left
/// to right; v = 0.5 - asin(d.y) / pi, top to bottom; texel centres at (i + 0.5) / W; bilinear, wrapping in
/// u, clamped in v. Turned by r degrees about +Y: look up R_Y(-r) d.
class Environment {
 public:
  /// Brighter than any light in any unit; from here up, sums over a picture could overflow.
  static constexpr float kMaxRadiance = 1e15f;

  /// Takes the picture's RGB. kBadInput for a value that is not finite or above kMaxRadiance (naming its
  /// pixel): whatever it was meant to be, it would outshine all else. Negative values become 0 and are
  /// counted in clamped(). `name` stands in messages.
  static Result<Environment> FromPicture(const Picture& picture, const std::string& name);
  static Result<Environment> Load(const std::filesystem::path& path);
  /// Own procedural skies: "studio" (soft boxes), "sunset" (small sun, horizon gradient), "uniform" (radiance
  /// 1). `width` x `width` / 2 texels, width in [16, 16384]. kUsage for another name or width.
  static Result<Environment> Procedural(const std::string& name, int width = 512);
  /// `procedural:NAME` or a path.
  static Result<Environment> Open(const std::string& path_or_name);

  int width() const { return width_; }
  int height() const { return height_; }
  const std::vector<glm::vec3>& texels() const { return texels_; }
  /// Channel values that were negative in the picture.
  uint64_t clamped() const { return clamped_; }
  /// Bilinear radiance; d unit.
  glm::vec3 Radiance(const glm::vec3& d) const;
  /// Direction of texel co-ordinates (u, v) in [0, 1]^2.
  static glm::vec3 Direction(float u, float v);
  static glm::vec2 Coordinates(const glm::vec3& d);

  /// Importance sampling: constant density (per solid angle) within a texel, proportional to the mean of the
  /// bilinear luminance over it, so that the density is positive wherever the radiance is. A black map is
  /// sampled uniformly. (u, v) in [0, 1)^2: u chooses along the row, v the row.
  struct Sample {
    glm::vec3 direction;
    float pdf;  ///< 1/sr
  };
  Sample SampleDirection(float u, float v) const;
  float Pdf(const glm::vec3& d) const;

 private:
  void BuildSampling();

  int width_ = 0, height_ = 0;
  std::vector<glm::vec3> texels_;
  uint64_t clamped_ = 0;
  // In double: next to a sun, the share of a dim texel is lost in the digits of a float sum.
  std::vector<double> row_cdf_;     ///< height + 1
  std::vector<double> column_cdf_;  ///< height x (width + 1)
  std::vector<double> sine_edges_;  ///< height + 1: y of the rows' edges, from +1 down to -1
};

/// d turned by -degrees about +Y: the direction to look up for an environment turned by `degrees` (none if
/// that is not finite).
glm::vec3 RotateForLookup(const glm::vec3& d, float degrees);

/// The same turn for many directions.
class LookupFrame {
 public:
  explicit LookupFrame(float degrees)
      : x_(RotateForLookup({1, 0, 0}, degrees)),
        y_(RotateForLookup({0, 1, 0}, degrees)),
        z_(RotateForLookup({0, 0, 1}, degrees)) {}
  glm::vec3 ToLookup(const glm::vec3& world) const { return x_ * world.x + y_ * world.y + z_ * world.z; }
  glm::vec3 ToWorld(const glm::vec3& lookup) const {
    return {glm::dot(x_, lookup), glm::dot(y_, lookup), glm::dot(z_, lookup)};
  }

 private:
  glm::vec3 x_, y_, z_;  ///< where the world's axes look up
};

}  // namespace glint
