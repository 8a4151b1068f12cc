#pragma once

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace glint {

/// Interpolated normals can tilt so far that the mirror direction of `wo` falls under the face. Such a normal
/// is bent towards the face's, just so far that the mirror direction stands min(0.9 face.wo, 0.01) above it
/// (the convention of Blender's Cycles, derived anew in the .cpp); any other normal comes back unchanged.
/// The tracer of references and the archive's look-ups share this, so that both see one surface.
/// @param face   unit normal of the face on wo's side: face.wo >= 0
/// @param wo     unit, towards the viewer
/// @param normal unit, interpolated
/// @return       unit, result.wo > 0 where face.wo > 0
inline glm::vec3 BendNormal(const glm::vec3& face, const glm::vec3& wo, const glm::vec3& normal);

namespace bend_normal_internal {

/// The same for a normal that must bend: the mirror direction's height over the face comes to `least`.
glm::vec3 Bend(const glm::vec3& face, const glm::vec3& wo, const glm::vec3& normal, float least);

}  // namespace bend_normal_internal

inline glm::vec3 BendNormal(const glm::vec3& face, const glm::vec3& wo, const glm::vec3& normal) {
  const float cos_face = glm::dot(face, wo), cos_o = glm::dot(normal, wo);
  const float least = std::min(0.9f * cos_face, 0.01f);
  const float height = 2.0f * cos_o * glm::dot(normal, face) - cos_face;
  if (height >= least && cos_o > 0) return normal;
  return bend_normal_internal::Bend(face, wo, normal, least);
}

}  // namespace glint
