#include "worker/hit_light.h"

#include <cmath>

#include "common/base/frame.h"
#include "common/lobes/vmf.h"

namespace glint {

std::array<float, 6> HitLight(const TransferReader& reader, const LayerViews& layer, int layer_index,
                              uint32_t triangle, float u, float v, const glm::vec3& wo) {
  TransferPoint point;
  if (!reader.Prepare(triangle, u, v, wo, &point)) return {};
  LayerLobes lobes;
  reader.Read(point, layer, layer_index, &lobes);
  std::array<float, 6> light{};
  for (int i = 0; i < lobes.count; ++i) {
    const TransferLobe& lobe = lobes.lobe[i];
    // Beyond kappa = 12 the hyperbolic cotangent is 1 to the last bit of a float.
    const float mean_cosine = lobe.kappa > 12 ? 1 - 1 / lobe.kappa : MeanCosineFromKappa(lobe.kappa);
    const float moment = Luminance(lobe.alpha) * mean_cosine;
    light[0] += lobe.alpha.x;
    light[1] += lobe.alpha.y;
    light[2] += lobe.alpha.z;
    light[3] += moment * lobe.mu.x;
    light[4] += moment * lobe.mu.y;
    light[5] += moment * lobe.mu.z;
  }
  return light;
}

}  // namespace glint
