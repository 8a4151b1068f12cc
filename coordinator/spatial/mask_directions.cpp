#include "coordinator/spatial/mask_directions.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace glint {

MaskDirections::MaskDirections() : nearest_(6 * kCells * kCells) {
  // A golden spiral.
  for (int i = 0; i < kCount; ++i) {
    const float z = 1 - (2 * static_cast<float>(i) + 1) / kCount;
    const float phi = 2.39996323f * static_cast<float>(i), r = std::sqrt(1 - z * z);
    directions_[i] = {r * std::cos(phi), r * std::sin(phi), z};
  }
  for (int face = 0; face < 6; ++face)
    for (int i = 0; i < kCells; ++i)
      for (int j = 0; j < kCells; ++j) {
        glm::vec3 middle(0);
        const int axis = face / 2;
        middle[axis] = face % 2 == 0 ? kCells : -kCells;
        middle[(axis + 1) % 3] = static_cast<float>(2 * i + 1 - kCells);
        middle[(axis + 2) % 3] = static_cast<float>(2 * j + 1 - kCells);
        const auto nearest = std::max_element(directions_.begin(), directions_.end(),
                                              [&](const glm::vec3& a, const glm::vec3& b) {
                                                return glm::dot(a, middle) < glm::dot(b, middle);
                                              });
        nearest_[CellOf(middle)] = static_cast<uint8_t>(nearest - directions_.begin());
      }
}

int MaskDirections::CellOf(const glm::vec3& d) {
  const glm::vec3 size(std::abs(d.x), std::abs(d.y), std::abs(d.z));
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const float scale = 0.5f * kCells / size[axis];
  const auto cell = [&](float x) {
    return std::clamp(static_cast<int>(x * scale + 0.5f * kCells), 0, kCells - 1);
  };
  const int face = 2 * axis + (d[axis] < 0 ? 1 : 0);
  return (face * kCells + cell(d[(axis + 1) % 3])) * kCells + cell(d[(axis + 2) % 3]);
}

}  // namespace glint
