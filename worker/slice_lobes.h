#pragma once

#include <glm/geometric.hpp>

#include "common/archive/transfer.h"
#include "common/lobes/slice_sampler.h"

namespace glint {

/// The unoccluded lobes of one slice: bake vertex side with unit normal `normal` seen from `wo`, normal . wo
/// > 0.
struct UnoccludedSlice {
  float cos_o;
  std::array<glm::vec3, 2> axes;  ///< IncidenceAxes
  BrdfSlice lobes;                ///< as fitted: what samples above the surface are weighed by

  UnoccludedSlice(const SliceSampler& sampler, const glm::vec3& normal, const glm::vec3& wo)
      : cos_o(glm::dot(normal, wo)), axes(IncidenceAxes(normal, wo)), lobes(sampler.Fitted(cos_o)) {}

  /// A lobe's direction, world.
  glm::vec3 Direction(const BrdfLobe& lobe) const { return axes[0] * lobe.mu_x + axes[1] * lobe.mu_z; }
  /// Lobe k as it is read out whole (AboveHorizon): what the stored one is relative to.
  BrdfLobe Seen(const SliceSampler& sampler, int k) const { return sampler.SeenLobe(cos_o, k); }
};

}  // namespace glint
