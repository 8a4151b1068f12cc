#pragma once

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <vector>

#include "common/render/float4.h"

namespace glint {

/// Direction -> [-1, 1]^2 by projection onto the octahedron, the lower half (y < 0) folded outwards
/// (Praun and Hoppe 2003). d need not be unit, but not zero.
inline glm::vec2 OctahedralFromDirection(const glm::vec3& d) {
  const float scale = 1 / (std::abs(d.x) + std::abs(d.y) + std::abs(d.z));
  const float x = d.x * scale, z = d.z * scale;
  if (d.y >= 0) return {x, z};
  return {std::copysign(1 - std::abs(z), x), std::copysign(1 - std::abs(x), z)};
}

/// The inverse, unit.
inline glm::vec3 DirectionFromOctahedral(const glm::vec2& p) {
  glm::vec3 d(p.x, 1 - std::abs(p.x) - std::abs(p.y), p.y);
  if (d.y < 0) {
    d.x = std::copysign(1 - std::abs(p.y), p.x);
    d.z = std::copysign(1 - std::abs(p.x), p.y);
  }
  return glm::normalize(d);
}

/// RGB over the sphere: side x side texels with centres at (i + 0.5) / side of [-1, 1], read bilinearly. One
/// ring of texels around it repeats what the fold puts beyond the edge, so that a look-up needs no wrapping.
class OctahedralMap {
 public:
  explicit OctahedralMap(int side = 0) : side_(side), texels_(size_t(side + 2) * (side + 2)) {}

  int side() const { return side_; }
  glm::vec3 TexelDirection(int x, int y) const {
    const float scale = 2.0f / static_cast<float>(side_);
    return DirectionFromOctahedral(
        {(static_cast<float>(x) + 0.5f) * scale - 1, (static_cast<float>(y) + 0.5f) * scale - 1});
  }
  /// Texel of the map itself, x and y in [0, side).
  glm::vec4& at(int x, int y) { return texels_[size_t(y + 1) * (side_ + 2) + x + 1]; }

  /// Fills the ring; call after the texels are set.
  void WrapBorder() {
    const int n = side_;
    for (int i = 0; i < n; ++i) {
      at(i, -1) = at(n - 1 - i, 0);
      at(i, n) = at(n - 1 - i, n - 1);
      at(-1, i) = at(0, n - 1 - i);
      at(n, i) = at(n - 1, n - 1 - i);
    }
    at(-1, -1) = at(n - 1, n - 1);
    at(n, n) = at(0, 0);
    at(-1, n) = at(n - 1, 0);
    at(n, -1) = at(0, n - 1);
  }

  /// Bilinear value at a position of OctahedralFromDirection.
  Float4 Bilinear(const glm::vec2& p) const {
    const float half = 0.5f * static_cast<float>(side_);
    const float x = p.x * half + half + 0.5f, y = p.y * half + half + 0.5f;  // in [0.5, side + 0.5]
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
    const glm::vec4* row = &texels_[size_t(iy) * (side_ + 2) + ix];
    const glm::vec4* next = row + side_ + 2;
    const Float4 a = LoadFloat4(row[0]) * (1 - fx) + LoadFloat4(row[1]) * fx;
    const Float4 b = LoadFloat4(next[0]) * (1 - fx) + LoadFloat4(next[1]) * fx;
    return a * (1 - fy) + b * fy;
  }

 private:
  int side_;
  std::vector<glm::vec4> texels_;
};

}  // namespace glint
