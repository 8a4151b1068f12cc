#include "common/lobes/horizon.h"

#include <algorithm>
#include <cmath>

#include "common/base/frame.h"

namespace glint {

BrdfLobe AboveHorizon(const BrdfLobe& lobe) {
  constexpr float kUncut = 0.995f;
  if (lobe.above > kUncut || lobe.kappa <= 0) return lobe;
  const float sigma = 1 / std::sqrt(std::max(lobe.kappa, 1.0f));
  const float a = std::asin(std::clamp(lobe.mu_z, -1.0f, 1.0f)) / sigma;
  const float upper = 0.5f * std::erfc(-a / std::sqrt(2.0f));
  // Far below the horizon the ratio goes to -a; there the lobe's rest lies along the horizon.
  const float h = upper > 1e-6f ? std::exp(-0.5f * a * a) / (std::sqrt(2 * kPi) * upper) : -a;
  const float rise = std::min(h * sigma, 0.5f);
  const float side = lobe.mu_x < 0 ? -1.0f : 1.0f;  // tangent (-side mu_z, side mu_x) points up
  BrdfLobe cut = lobe;
  cut.mu_x = lobe.mu_x - side * lobe.mu_z * rise;
  cut.mu_z = lobe.mu_z + side * lobe.mu_x * rise;
  const float length = std::sqrt(cut.mu_x * cut.mu_x + cut.mu_z * cut.mu_z);
  cut.mu_x /= length;
  cut.mu_z /= length;
  const float narrowing = std::clamp(a * h + h * h, 0.0f, 1.0f);
  cut.kappa = std::min(lobe.kappa * 2 / (2 - narrowing), lobe.kappa * 2);
  return cut;
}

}  // namespace glint
