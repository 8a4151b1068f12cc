#pragma once

#include <glm/geometric.hpp>

#include "common/archive/transfer.h"
#include "common/domain/bake_domain.h"

namespace glint {

/// The unoccluded lobes of one slice: bake vertex side with unit normal `normal` seen from `wo`, normal . wo
/// > 0.
struct UnoccludedSlice {
  BrdfSlice slice;
  std::array<glm::vec3, kMaxBrdfLobes> mu;  ///< world

  UnoccludedSlice(const BrdfShape& shape, const glm::vec3& normal, const glm::vec3& wo)
      : slice(LookupSlice(shape, glm::dot(normal, wo))) {
    const auto [x, z] = IncidenceAxes(normal, wo);
    for (int k = 0; k < slice.lobes; ++k) mu[k] = x * slice.lobe[k].mu_x + z * slice.lobe[k].mu_z;
  }
};

}  // namespace glint
