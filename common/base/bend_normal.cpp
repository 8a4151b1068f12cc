#include "common/base/bend_normal.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace glint::bend_normal_internal {

// In the plane of face and normal let n(a) = cos(a) face + sin(a) x, and wo's part in that plane be r (cos f,
// sin f). The mirror direction 2 (n.wo) n - wo has height 2 r cos(a - f) cos(a) - r cos(f) = r cos(2a - f)
// over the face. It is above `least` from a = 0 (where the height is face.wo) up to 2a = f + acos(least / r).
glm::vec3 Bend(const glm::vec3& face, const glm::vec3& wo, const glm::vec3& normal, float least) {
  const float cos_face = glm::dot(face, wo);
  const glm::vec3 across = normal - glm::dot(normal, face) * face;
  const float length = glm::length(across);
  if (length < 1e-6f) return face;  // the normal is the face's, or its opposite
  const glm::vec3 x = across / length;
  const float wo_x = glm::dot(x, wo);
  const float r = std::hypot(wo_x, cos_face);
  if (!(r > 0)) return face;  // edge-on, along the fold: every normal in the plane mirrors wo to -wo
  const float a = 0.5f * (std::atan2(wo_x, cos_face) + std::acos(std::clamp(least / r, 0.0f, 1.0f)));
  return glm::normalize(std::cos(a) * face + std::sin(a) * x);
}

}  // namespace glint::bend_normal_internal
