#pragma once

#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "common/archive/chunk.h"
#include "common/archive/lobe_codec.h"
#include "common/lobes/vmf.h"

namespace glint {

/// The unoccluded lobe that a stored one is relative to, as it is read out.
struct SliceLobe {
  glm::vec3 mu{0, 0, 1};  ///< world
  float kappa = 0;
  /// Samples were weighed by a lobe that is this much broader, because they resolve no sharper one: its kappa
  /// over the BRDF's, in (0, 1].
  float resolution = 1;

  float resolved_kappa() const { return kappa * resolution; }
};

/// Sums over a lobe's samples, relative to the sum of all their weights.
struct DirectMoments {
  double visible = 1;  ///< weight of the unblocked ones, in [0, 1]
  glm::dvec3 mean{0};  ///< sum of weight * direction over the unblocked ones, world
};

/// Rays of equal weight that were drawn from a lobe and leave the surface.
struct BlockedRays {
  double all = 0, blocked = 0;            ///< counts
  glm::dvec3 all_sum{0}, blocked_sum{0};  ///< of their directions, world

  void Add(const glm::vec3& direction, bool is_blocked);
  /// The unoccluded lobe's mean is known: rays tell what blocking changes. Nothing is visible if there are
  /// none.
  DirectMoments Moments(const SliceLobe& lobe) const;
};

struct IndirectMoments {
  glm::dvec3 alpha{0};   ///< mean light, RGB
  glm::dvec3 moment{0};  ///< mean of luminance * ||r|| mu, world
};

/// Lobe with first moment `moment` and total weight `weight` > 0. A handful of samples can look sharper than
/// they are: the width never falls below a quarter of the lobe's that weighed them
/// (1 - ||r|| >= 1 / (16 kappa)).
Vmf LobeOf(const glm::dvec3& moment, double weight, const SliceLobe& lobe);

/// The lobe that these moments describe (laurijssen2011 Eq. 3, 9 with the exact kappa), relative to the
/// unoccluded one; visible > 0.
DirectLobe DirectLobeOf(const SliceLobe& lobe, const DirectMoments& moments);
IndirectLobe IndirectLobeOf(const SliceLobe& lobe, const IndirectMoments& moments);

/// A whole slice as one lobe. Nothing if blockers change it by less than `drop`: it is free.
std::optional<DirectLobe> FitDirect(const SliceLobe& lobe, const DirectMoments& moments, float drop);
/// Nothing if the slice's light is below `drop`.
std::optional<IndirectLobe> FitIndirect(const SliceLobe& lobe, const IndirectMoments& moments, float drop);

void StoreDirect(const std::optional<DirectLobe>& lobe, uint16_t column, BlockRows* rows);
void StoreIndirect(const std::optional<IndirectLobe>& lobe, uint16_t column, BlockRows* rows);

}  // namespace glint
