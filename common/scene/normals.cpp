#include "common/scene/normals.h"

#include <cmath>
#include <glm/geometric.hpp>

namespace glint {

std::vector<glm::vec3> AngleWeightedNormals(std::span<const glm::vec3> positions,
                                            std::span<const std::array<uint32_t, 3>> triangles) {
  // Double: triangles may be tiny against their distance from the origin.
  std::vector<glm::dvec3> sums(positions.size(), glm::dvec3(0));
  for (const auto& triangle : triangles) {
    const glm::dvec3 p[3] = {positions[triangle[0]], positions[triangle[1]], positions[triangle[2]]};
    const glm::dvec3 cross = glm::cross(p[1] - p[0], p[2] - p[0]);
    const double twice_area = glm::length(cross);
    if (!(twice_area > 0)) continue;
    const glm::dvec3 face = cross / twice_area;
    for (int corner = 0; corner < 3; ++corner) {
      const glm::dvec3 a = p[(corner + 1) % 3] - p[corner];
      const glm::dvec3 b = p[(corner + 2) % 3] - p[corner];
      sums[triangle[corner]] += face * std::atan2(twice_area, glm::dot(a, b));
    }
  }
  std::vector<glm::vec3> normals(positions.size());
  for (size_t i = 0; i < sums.size(); ++i) {
    const double length = glm::length(sums[i]);
    normals[i] = length > 1e-12 ? glm::vec3(sums[i] / length) : glm::vec3(0, 1, 0);
  }
  return normals;
}

}  // namespace glint
