#pragma once

#include <algorithm>
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

/// What stands for the width in LightOf where a slice has several direct lobes: that of the one lobe with
/// their moments, for small angles. Each of them alone is sharper than that, and a slice beside it may well
/// be one lobe of about the same light.
class DirectWidth {
 public:
  void Add(const DirectLobe& lobe) {
    ++lobes_;
    fraction_ += lobe.fraction;
    inverse_ratio_ += lobe.fraction / lobe.kappa_ratio;
    shift_ += lobe.fraction * lobe.shift;
    square_ += lobe.fraction * glm::dot(lobe.shift, lobe.shift);
  }
  int lobes() const { return lobes_; }
  /// @param kappa  the unoccluded lobe's
  float Light(float kappa) const {
    if (fraction_ <= 0) return 0;
    const float apart = square_ - glm::dot(shift_, shift_) / fraction_;
    return 0.5f * fraction_ * fraction_ / (inverse_ratio_ + 0.5f * kappa * std::max(apart, 0.0f));
  }

 private:
  int lobes_ = 0;
  float fraction_ = 0, inverse_ratio_ = 0, square_ = 0;
  glm::vec3 shift_{0};
};

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
