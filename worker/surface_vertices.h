#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "common/domain/bake_domain.h"

namespace glint {

/// One side of a bake vertex, as rays leave it.
struct VertexSide {
  glm::vec3 origin;     ///< where rays start: off the surface, and drawn in from its border
  glm::vec3 normal;     ///< unit shading normal of this side
  glm::vec3 geometric;  ///< unit, angle-weighted mean of the faces around, on this side
};

/// Where and how rays leave the bake vertices. A vertex on a border often lies exactly on another surface (a
/// floor's edge on a wall), where a ray would start on the wrong side or on no side at all; so origins are
/// moved a little towards the middle of the faces around, within the tangent plane or up to the face that is
/// above it there, and up by RayScene::epsilon().
class SurfaceVertices {
 public:
  SurfaceVertices(const BakeDomain& domain, float epsilon);

  VertexSide side(uint32_t vertex, bool back) const;
  /// False for vertices that no triangle uses: they have no slices.
  bool used(uint32_t vertex) const { return used_[vertex]; }
  /// True if `triangle` has `vertex` as a corner.
  bool Incident(uint32_t triangle, uint32_t vertex) const {
    const auto& t = domain_.triangles[triangle];
    return t[0] == vertex || t[1] == vertex || t[2] == vertex;
  }
  /// Unit; 0 for a triangle without area.
  const glm::vec3& face_normal(uint32_t triangle) const { return face_normal_[triangle]; }
  /// Hits of incident triangles nearer than this lie at the vertex itself.
  float touch_distance(uint32_t vertex) const { return touch_[vertex]; }

 private:
  void AverageCorners();
  void RaiseOverFace(uint32_t triangle);

  const BakeDomain& domain_;
  float epsilon_;
  std::vector<glm::vec3> inset_, geometric_, face_normal_;
  std::vector<float> touch_;
  std::vector<std::array<float, 2>> rise_;  ///< of the origin over the tangent plane: front, back
  std::vector<uint8_t> used_;
};

}  // namespace glint
