#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "common/archive/lobe_codec.h"
#include "common/base/frame.h"
#include "common/lobes/vmf.h"

namespace glint {

/// A stored lobe's light and first moment, relative to the unoccluded lobe's weight. Linear in the lobes of a
/// slice: sums and weighted means are those of what is read. Direct: alpha is the unblocked part, twice, and
/// that times half the ratio of kappa; the moment is that part times the shift.
struct EntryLight {
  glm::vec3 alpha{0}, moment{0};

  EntryLight& Add(const EntryLight& other, float weight = 1) {
    alpha += weight * other.alpha;
    moment += weight * other.moment;
    return *this;
  }
};

inline EntryLight LightOf(const DirectLobe& lobe) {
  return {lobe.fraction * glm::vec3(1, 1, 0.5f * lobe.kappa_ratio), lobe.fraction * lobe.shift};
}

inline EntryLight LightOf(const IndirectLobe& lobe) {
  return {lobe.alpha, Luminance(lobe.alpha) * MeanCosineFromKappa(lobe.kappa) * lobe.mu};
}

inline constexpr float kJudgedLightKappa = 64;  ///< lights that distances are judged under are this sharp

/// Square of how far two slices are apart when relit, 1 being all that the surface reflects:
///
///   d^2 = (alpha - alpha')^2 + kappa_s / 2 |m - m'|^2
///
/// The first term (mean square of the colours) is the error under a sky that is everywhere the same, the
/// second that under lights of kJudgedLightKappa: for small shifts it is the L2 distance of the lobes,
/// relative to the unoccluded one's norm, both blurred by the light.
/// @param kappa  kappa_s: the unoccluded lobe's as seen under such a light, at most kJudgedLightKappa
inline float Distance2(const EntryLight& a, const EntryLight& b, float kappa = kJudgedLightKappa) {
  const glm::vec3 alpha = a.alpha - b.alpha, moment = a.moment - b.moment;
  return glm::dot(alpha, alpha) / 3 + 0.5f * kappa * glm::dot(moment, moment);
}

}  // namespace glint
