#pragma once

#include <cmath>
#include <glm/vec3.hpp>

namespace glint {

/// Largest magnitude of a vertex's coordinate. The ray tracer stops the whole process at coordinates beyond
/// about 1.8e18; below this bound, sums and distances stay well away from that.
inline constexpr float kMaxCoordinate = 1e15f;
/// The same for a camera, which may stand off the scene.
inline constexpr float kMaxEye = 1e17f;

/// Every coordinate is a number of magnitude `bound` or less.
inline bool Within(const glm::vec3& v, float bound) {
  return std::abs(v.x) <= bound && std::abs(v.y) <= bound && std::abs(v.z) <= bound;
}

}  // namespace glint
