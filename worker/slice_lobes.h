#pragma once

#include <glm/geometric.hpp>

#include "common/archive/transfer.h"
#include "common/domain/bake_domain.h"
#include "common/lobes/horizon.h"

namespace glint {

/// The unoccluded lobes of one slice: bake vertex side with unit normal `normal` seen from `wo`, normal . wo
/// > 0.
struct UnoccludedSlice {
  BrdfSlice lobes;  ///< as fitted: what samples above the surface are weighed by
  BrdfSlice seen;   ///< as they are read out whole (AboveHorizon): what stored lobes are relative to
  std::array<glm::vec3, kMaxBrdfLobes> mu, seen_mu;  ///< their directions, world

  UnoccludedSlice(const BrdfShape& shape, const glm::vec3& normal, const glm::vec3& wo)
      : lobes(LookupSlice(shape, glm::dot(normal, wo))), seen(lobes) {
    const auto [x, z] = IncidenceAxes(normal, wo);
    for (int k = 0; k < lobes.lobes; ++k) {
      seen.lobe[k] = AboveHorizon(lobes.lobe[k]);
      mu[k] = x * lobes.lobe[k].mu_x + z * lobes.lobe[k].mu_z;
      seen_mu[k] = x * seen.lobe[k].mu_x + z * seen.lobe[k].mu_z;
    }
  }
};

}  // namespace glint
