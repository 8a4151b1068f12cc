#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/domain/bake_domain.h"
#include "common/scene/ray_scene.h"
#include "coordinator/spatial/vertex_hierarchy.h"

namespace glint {

/// What nodes see in a fixed set of directions, the same for all: the outside, the inside of something, or a
/// part of the scene, how far away and turned how.
class VisibilityMasks {
 public:
  static constexpr int kDirections = 96;

  VisibilityMasks(const BakeDomain& domain, const RayScene& rays);

  /// To call when the domain has more nodes. Known masks stay.
  void Turn();
  /// Sees to it that these nodes' masks are known.
  void Look(std::span<const uint32_t> nodes, int threads);
  /// Nodes whose masks are known.
  uint64_t known() const { return known_count_; }
  /// Square of how much two nodes differ in what they see: the mean over the directions above both horizons
  /// of 1 where it is not the same thing, kShape^2 where that is at another depth or turned away.
  double Difference(uint32_t a, uint32_t b) const;
  /// The same for what is seen by a node and by those that it is predicted from, whose weights add up to 1.
  /// Over the directions above the node's horizon; what is seen by some of the others counts by their weight.
  double SquareError(uint32_t node, std::span<const Parent> prediction) const;
  /// Nothing reaches the node: all that it sees are insides.
  bool Dark(uint32_t node) const;

 private:
  /// Weight of what is seen at another depth, or turned away.
  static constexpr double kShape = 0.25;
  struct Sight {
    uint8_t what;
    int8_t depth;                  ///< logarithm of the distance, 8 to the octave
    std::array<int8_t, 3> normal;  ///< of the surface, times 127
  };
  using Mask = std::array<Sight, kDirections>;
  Mask Trace(uint32_t node) const;
  Sight Seen(const Hit& hit, const glm::vec3& direction) const;
  /// Weight, 0 to 1, of what a prediction gets wrong of one direction.
  double Wrong(uint32_t node, int direction, std::span<const Parent> prediction) const;

  const BakeDomain& domain_;
  const RayScene& rays_;
  std::vector<glm::vec3> directions_;
  std::vector<uint8_t> piece_;  ///< of each triangle: of the connected piece that it belongs to, 2 and up
  std::vector<Mask> masks_;     ///< of each node
  std::vector<uint8_t> known_;
  uint64_t known_count_ = 0;
};

}  // namespace glint
