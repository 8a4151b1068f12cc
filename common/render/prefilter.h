#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "common/render/environment.h"

namespace glint {

/// The environment convolved with vMF lobes for a ladder of kappa (factor 2 steps, from 0 to what the texels resolve),
/// each level an octahedral map just fine enough for its kappa, computed from a source of fitting resolution; and the
/// cosine-weighted irradiance. Swapping an environment costs one build; turning it costs nothing.
class PrefilteredEnvironment {
 public:
  explicit PrefilteredEnvironment(const Environment& environment, int threads = 0);

  /// integral of L(s) gamma(s; mu, kappa) ds; interpolated in log kappa. Beyond the sharpest level: the plain map.
  glm::vec3 Filtered(const glm::vec3& mu, float kappa) const;
  /// integral of L(s) max(0, n.s) / pi ds.
  glm::vec3 CosineAverage(const glm::vec3& n) const;
  /// Background radiance.
  glm::vec3 Radiance(const glm::vec3& d) const;

 private:
  struct Level {
    float kappa = 0;
    int side = 0;                   ///< octahedral texels per side, without the border
    std::vector<glm::vec3> texels;  ///< (side + 2)^2, border evaluated on the wrapped directions
  };
  std::vector<Level> levels_;
  Level cosine_;
  Environment environment_;
};

}  // namespace glint
