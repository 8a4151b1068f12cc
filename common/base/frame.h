#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace glint {

/// Right-handed orthonormal frame (t, b, n) around the unit vector n, continuous except at n = -Z
/// (Duff et al. 2017).
struct Frame {
  glm::vec3 t, b, n;

  static Frame FromNormal(const glm::vec3& n) {
    const float sign = std::copysign(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float c = n.x * n.y * a;
    return {{1.0f + sign * n.x * n.x * a, sign * c, -sign * n.x}, {c, sign + n.y * n.y * a, -n.y}, n};
  }
  glm::vec3 ToWorld(const glm::vec3& v) const { return t * v.x + b * v.y + n * v.z; }
  glm::vec3 ToLocal(const glm::vec3& v) const { return {glm::dot(t, v), glm::dot(b, v), glm::dot(n, v)}; }
};

/// Rec. 709 luminance of linear RGB.
inline float Luminance(const glm::vec3& c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

inline constexpr float kPi = 3.14159265358979323846f;

}  // namespace glint
