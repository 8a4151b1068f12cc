#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/scene/scene.h"

namespace glint {

/// One ring of a tube: center + radius (cos phi a + sin phi b), a and b orthonormal. Radius 0 is a pole: one
/// vertex.
struct Ring {
  glm::dvec3 center, a, b;
  double radius;
};

/// Points on a uniform cubic B-spline with these control points, evenly spread by arc length plus `bend`
/// times the total length for every radian of turning, so that tight bends get more points. First and last
/// are the curve's ends.
/// @param parameters if given, receives each point's position along the curve in [0, 1] (by spline
/// parameter).
std::vector<glm::dvec2> SampleSpline(std::span<const glm::dvec2> control, int count, double bend,
                                     std::vector<double>* parameters = nullptr);

/// Rows and columns that spread `vertices` over a tube of this length and mean circumference in squarish
/// cells.
struct TubeSize {
  int rows, columns;
};
TubeSize SizeTube(double vertices, double length, double circumference);

/// Appends surfaces to a scene; vertices are welded within each surface. Finish() makes normals and the hash.
class MeshBuilder {
 public:
  uint16_t AddMaterial(const Material& material);

  /// Stitches successive rings; a x b points along the tube, and the front faces outwards.
  /// @param closed the last ring continues to the first
  void AddTube(std::span<const Ring> rings, int columns, bool closed, uint16_t material);

  /// Rows x columns grid of corner + u e_u + v e_v, u, v in [0, 1]; front towards e_u x e_v.
  void AddPatch(const glm::dvec3& corner, const glm::dvec3& e_u, const glm::dvec3& e_v, int rows, int columns,
                uint16_t material);

  /// Sphere-like surface: `place` maps unit directions to positions. Six n x n faces of an equal-angle cube:
  /// 6 n^2 + 2 vertices.
  void AddStarShape(int n, const std::function<glm::dvec3(const glm::dvec3&)>& place, uint16_t material);

  uint32_t vertex_count() const { return static_cast<uint32_t>(scene_.positions.size()); }
  Scene Finish(const Camera& camera);

 private:
  uint32_t AddVertex(const glm::dvec3& position, uint16_t material);
  void AddTriangle(uint32_t a, uint32_t b, uint32_t c, uint16_t material);
  Scene scene_;
};

}  // namespace glint
