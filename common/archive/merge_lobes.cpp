#include "common/archive/merge_lobes.h"

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

}  // namespace glint
