#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace glint {

/// A fixed set of directions all around, evenly spread, and which of them is next to any other. Thread-safe.
class MaskDirections {
 public:
  static constexpr int kCount = 96;

  MaskDirections();

  const glm::vec3& operator[](int i) const { return directions_[i]; }
  /// @param direction  not zero
  /// @return           the nearest of the set; near the middle between two, to 2 degrees, either of them
  int Nearest(const glm::vec3& direction) const { return nearest_[CellOf(direction)]; }

 private:
  static constexpr int kCells = 24;  ///< along an edge of a cube around
  static int CellOf(const glm::vec3& direction);

  std::array<glm::vec3, kCount> directions_;
  std::vector<uint8_t> nearest_;  ///< to the middle of each cell of the cube's faces
};

}  // namespace glint
