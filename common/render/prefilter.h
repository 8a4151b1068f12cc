#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "common/render/environment.h"
#include "common/render/irradiance.h"
#include "common/render/octahedral_map.h"

namespace glint {

/// The environment convolved with vMF lobes for a ladder of kappa (factor 2 steps, from 1/2 to what the
/// texels resolve, at most 32768), each level an octahedral map just fine enough for its kappa, computed from
/// a source of fitting resolution; and the cosine-weighted irradiance. Swapping an environment costs one
/// build; turning it costs nothing.
class PrefilteredEnvironment {
 public:
  /// `threads` 0: one per core. The result does not depend on it.
  explicit PrefilteredEnvironment(const Environment& environment, int threads = 0);

  /// integral of L(s) gamma(s; mu, kappa) ds; mu unit, kappa >= 0. Interpolated in log kappa between levels,
  /// in kappa towards the mean below the lowest; beyond the sharpest it goes over into the plain map.
  glm::vec3 Filtered(const glm::vec3& mu, float kappa) const;
  /// integral of L(s) max(0, n.s) / pi ds.
  glm::vec3 CosineAverage(const glm::vec3& n) const;
  /// Background radiance.
  glm::vec3 Radiance(const glm::vec3& d) const;

 private:
  void BuildLevels(int threads);
  void BuildCosine(int threads);
  glm::vec3 BeyondSharpest(const glm::vec3& mu, float kappa) const;

  std::vector<OctahedralMap> levels_;  ///< level i: kappa = kLowestKappa 2^i
  OctahedralMap cosine_;               ///< irradiance / pi without the bright blocks
  std::vector<IrradianceMoment> bright_;
  glm::vec3 mean_{0};         ///< kappa = 0
  float sharpest_kappa_ = 0;  ///< of the last level
  float texel_variance_ = 0;  ///< rad^2, per axis: width of the map's bilinear filter
  Environment environment_;
};

}  // namespace glint
