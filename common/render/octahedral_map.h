#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <vector>

#include "common/base/octahedral.h"
#include "common/render/float4.h"

namespace glint {

/// RGB over the sphere: (side + 1)^2 nodes, side even, the outermost on the edge of [-1, 1]^2, linear on
/// triangles that do not cross an edge of the octahedron. The map has a kink at all of these edges (the
/// equator, and where the fold meets itself): bilinear cells across them would err by the first power of
/// their width instead of the second.
class OctahedralMap {
 public:
  explicit OctahedralMap(int side = 0) : side_(side), nodes_(size_t(side + 1) * (side + 1)) {}

  int side() const { return side_; }
  /// x and y in [0, side].
  glm::vec3 NodeDirection(int x, int y) const {
    const float scale = 2.0f / static_cast<float>(side_);
    return DirectionFromOctahedral({static_cast<float>(x) * scale - 1, static_cast<float>(y) * scale - 1});
  }
  glm::vec4& at(int x, int y) { return nodes_[size_t(y) * (side_ + 1) + x]; }

  /// Value at a position of OctahedralFromDirection.
  Float4 Interpolated(const glm::vec2& p) const {
    const float half = 0.5f * static_cast<float>(side_);
    // In this order of arguments max also makes 0 of what is not a number: it must not become an index.
    const float x = std::max(0.0f, p.x * half + half), y = std::max(0.0f, p.y * half + half);
    const int ix = std::min(static_cast<int>(x), side_ - 1), iy = std::min(static_cast<int>(y), side_ - 1);
    float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
    // The corner that the triangle's legs leave from, and the steps along them. Cells are cut along the
    // diagonal that runs with the octahedron's edge of their quadrant.
    std::ptrdiff_t dx = 1, dy = side_ + 1, corner = iy * dy + ix;
    if ((2 * ix < side_) != (2 * iy < side_)) {
      corner += dx;
      dx = -dx;
      fx = 1 - fx;
    }
    if (fx + fy > 1) {
      corner += dx + dy;
      dx = -dx;
      dy = -dy;
      fx = 1 - fx;
      fy = 1 - fy;
    }
    const glm::vec4* node = &nodes_[static_cast<size_t>(corner)];
    return LoadFloat4(node[0]) * (1 - fx - fy) + LoadFloat4(node[dx]) * fx + LoadFloat4(node[dy]) * fy;
  }

 private:
  int side_;
  std::vector<glm::vec4> nodes_;
};

}  // namespace glint
