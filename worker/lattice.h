#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace glint {

/// side x side cells of equal solid angle over the hemisphere z > 0 (the concentric map of the square to the
/// disk, then Lambert's equal-area map). Cells are ordered along a Morton curve, so that sixteen in a row
/// make a 4 x 4 tile of neighbours; each cell also has its four quarters.
class HemisphereLattice {
 public:
  static constexpr int kTileCells = 16;
  /// @param side  multiple of 4
  explicit HemisphereLattice(int side);

  int side() const { return side_; }
  int cells() const { return side_ * side_; }
  int tiles() const { return cells() / kTileCells; }
  float solid_angle() const { return solid_angle_; }  ///< of a cell, sr
  const glm::vec3& direction(int cell) const { return directions_[cell]; }
  const glm::vec3& quarter(int cell, int i) const { return quarters_[4 * cell + i]; }
  /// Cell right of / below `cell` on the square, or -1 at its border.
  int right(int cell) const { return right_[cell]; }
  int below(int cell) const { return below_[cell]; }

  struct Cone {
    glm::vec3 axis;
    float cos_radius, sin_radius;
  };
  /// Contains every sample of the tile, quarters too.
  const Cone& tile_cone(int tile) const { return cones_[tile]; }

 private:
  int side_;
  float solid_angle_;
  std::vector<glm::vec3> directions_, quarters_;
  std::vector<int> right_, below_;
  std::vector<Cone> cones_;
};

/// The unit square mapped with equal areas to the hemisphere z >= 0.
glm::vec3 SquareToHemisphere(float u, float v);

}  // namespace glint
