#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/domain/bake_domain.h"
#include "common/scene/ray_scene.h"

namespace glint {

/// What nodes see in a fixed set of directions, the same for all: the outside, or which part of the scene.
class VisibilityMasks {
 public:
  static constexpr int kDirections = 96;

  VisibilityMasks(const BakeDomain& domain, const RayScene& rays);

  /// To call when the domain has more nodes. Known masks stay.
  void Turn();
  /// Sees to it that these nodes' masks are known.
  void Look(std::span<const uint32_t> nodes, int threads);
  /// Part of the directions above both horizons in which two nodes see different things.
  double Difference(uint32_t a, uint32_t b) const;

 private:
  using Mask = std::array<uint8_t, kDirections>;
  Mask Trace(uint32_t node) const;

  const BakeDomain& domain_;
  const RayScene& rays_;
  std::vector<glm::vec3> directions_;
  std::vector<uint8_t> piece_;  ///< of each triangle: of the connected piece that it belongs to, 2 and up
  std::vector<Mask> masks_;     ///< of each node
  std::vector<uint8_t> known_;
};

}  // namespace glint
