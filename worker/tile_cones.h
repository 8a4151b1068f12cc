#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "worker/gather_kernel.h"

namespace glint {

/// Bounding cones of tiles, in the order in which they were added, with a bound around each kLanes in a row:
/// most queries meet a few tiles out of hundreds. Buffers are reused.
class ConeList {
 public:
  struct Cone {
    glm::vec3 axis;
    float cos_radius, sin_radius;
  };

  void Clear();
  void Add(const Cone& cone);
  /// Pads and bounds what was added; nothing may be added until Clear().
  void Finish();
  /// Valid until the list changes.
  ConeTree tree() const { return {tiles_.view(), groups_.view()}; }
  bool empty() const { return tiles_.x.empty(); }

 private:
  struct Arrays {
    std::vector<float> x, y, z, cos_radius, sin_radius;
    void Clear();
    void Add(const Cone& cone);
    void Pad();
    TileCones view() const;
  };
  Cone Bound(size_t first, size_t end) const;

  Arrays tiles_, groups_;
};

}  // namespace glint
