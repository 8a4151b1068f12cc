#pragma once

#include <algorithm>
#include <array>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "common/archive/transfer.h"
#include "common/lobes/lobe_sky.h"

namespace glint {

inline constexpr int kSkiesPerSlice = 4;

/// Radiance under each of a slice's skies, linear RGB.
using SkyLight = std::array<glm::vec3, kSkiesPerSlice>;

/// Adds what one term of the transfer reflects at a point with shading normal `normal`, as ArchiveRenderer
/// reads it.
inline void AddReflected(const TransferLobe& lobe, const glm::vec3& normal, const std::vector<LobeSky>& skies,
                         SkyLight* sum) {
  for (int s = 0; s < kSkiesPerSlice; ++s) {
    const LobeSky& sky = skies[s];
    float light = sky.Filtered({lobe.mu, lobe.kappa});
    if (lobe.cosine)
      light = std::max(0.0f, sky.CosineAverage(normal) - sky.Filtered({normal, kCosineKappa}) + light);
    (*sum)[s] += lobe.alpha * light;
  }
}

inline SkyLight operator-(const SkyLight& a, const SkyLight& b) {
  SkyLight out;
  for (int s = 0; s < kSkiesPerSlice; ++s) out[s] = a[s] - b[s];
  return out;
}

inline SkyLight operator+(const SkyLight& a, const SkyLight& b) {
  SkyLight out;
  for (int s = 0; s < kSkiesPerSlice; ++s) out[s] = a[s] + b[s];
  return out;
}

}  // namespace glint
