#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace glint {

/// Direction -> [-1, 1]^2 by projection onto the octahedron, the lower half (y < 0) folded outwards
/// (Praun and Hoppe 2003). d need not be unit, but not zero.
inline glm::vec2 OctahedralFromDirection(const glm::vec3& d) {
  const float norm = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
  const float x = d.x / norm, z = d.z / norm;
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

}  // namespace glint
