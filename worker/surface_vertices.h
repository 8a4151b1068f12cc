#pragma once

#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "common/domain/bake_domain.h"
#include "common/scene/ray_scene.h"

namespace glint {

/// One side of a bake vertex, as rays leave it.
struct VertexSide {
  glm::vec3 origin;     ///< where rays start: off the surface, and drawn in from its border
  glm::vec3 normal;     ///< unit shading normal of this side
  glm::vec3 geometric;  ///< unit, angle-weighted mean of the faces around, on this side

  /// Whether a direction points away from those faces.
  bool Faces(const glm::vec3& direction) const { return glm::dot(direction, geometric) > 0; }
};

/// Where and how rays leave the bake vertices. A vertex on a border often lies exactly on another surface (a
/// floor's edge on a wall), where a ray would start on the wrong side or on no side at all; so origins are
/// moved a little towards the middle of the faces around, within the tangent plane or up to the face that is
/// above it there, and up by RayScene::epsilon(). A middle's faces are the one or two triangles that it lies
/// on; what is done there depends on it alone, not on what else is split.
class SurfaceVertices {
 public:
  SurfaceVertices(const BakeDomain& domain, float epsilon);

  /// @param row  of a bake vertex
  VertexSide side(uint32_t row, bool back) const;
  /// False for vertices that no triangle uses: they have no slices.
  bool used(uint32_t row) const { return Start(row).used; }
  /// Whether a ray leaves the surface at a bake vertex: it does not point under the faces around, nor meet
  /// them at the vertex itself. Others are neither free nor blocked: a lobe's weight is shared out among the
  /// directions that do leave, as when a normal is bent towards its face.
  /// @param side  of `row`
  bool Leaves(uint32_t row, const VertexSide& side, const glm::vec3& direction, const Hit& hit) const {
    return side.Faces(direction) && !Touches(row, hit);
  }
  /// Whether a hit lies on the faces around a bake vertex, at the vertex itself.
  bool Touches(uint32_t row, const Hit& hit) const {
    return hit.hit() && hit.t < Start(row).touch && Incident(hit.triangle, row);
  }
  /// Unit; 0 for a triangle without area.
  const glm::vec3& face_normal(uint32_t triangle) const { return face_normal_[triangle]; }

 private:
  struct NodeStart {
    glm::vec3 inset{0}, geometric{0};
    float touch = 0;  ///< hits of incident triangles nearer than this lie at the bake vertex itself
    std::array<float, 2> rise{};  ///< of the origin over the tangent plane: front, back
    bool used = false;
  };

  /// True if the bake vertex lies on `triangle`.
  bool Incident(uint32_t triangle, uint32_t row) const;
  const NodeStart& Start(uint32_t row) const { return starts_[domain_.RowNode(row)]; }
  void AverageCorners();
  void RaiseOverFace(uint32_t triangle);
  void StartFromMiddle(uint32_t middle);

  const BakeDomain& domain_;
  float epsilon_;
  std::vector<NodeStart> starts_;  ///< of nodes
  std::vector<glm::vec3> face_normal_;
};

}  // namespace glint
