#include "common/archive/merge_lobes.h"

#include <algorithm>

#include "common/archive/blend.h"
#include "common/base/frame.h"
#include "common/lobes/vmf.h"

namespace glint {

IndirectLobe MergeLobes(std::span<const IndirectLobe> lobes) {
  glm::vec3 alpha(0);
  VmfMoments moments;
  for (const IndirectLobe& lobe : lobes) {
    alpha += lobe.alpha;
    moments.Add(Luminance(lobe.alpha), {lobe.mu, lobe.kappa});
  }
  const Vmf merged = moments.Lobe();
  return {alpha, merged.mu, merged.kappa};
}

DirectLobe MergeLobes(std::span<const DirectLobe> lobes, const Vmf& whole) {
  DirectLobe merged{.fraction = 0};
  VmfMoments moments;
  for (const DirectLobe& lobe : lobes) {
    merged.fraction += lobe.fraction;
    moments.Add(lobe.fraction, {UnitOr(whole.mu + lobe.shift, whole.mu),
                                std::min(whole.kappa * lobe.kappa_ratio, kMaxKappa)});
  }
  if (merged.fraction <= 0) return {.fraction = 0};
  const Vmf lobe = moments.Lobe();
  merged.fraction = std::min(merged.fraction, 1.0f);
  merged.shift = lobe.mu - whole.mu;
  merged.kappa_ratio = lobe.kappa / std::max(whole.kappa, 1e-6f);
  return merged;
}

}  // namespace glint
