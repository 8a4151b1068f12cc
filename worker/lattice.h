#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "worker/tile_cones.h"

namespace glint {

/// side x side cells of equal solid angle over the hemisphere z > 0 (the concentric map of the square to the
/// disk, then Lambert's equal-area map). Cells are ordered along a Morton curve, so that eight in a row
/// make a 4 x 2 tile of neighbours; and cells have quarters, which have quarters. Samples lie in the middle,
/// but those of whole cells along the horizon lie in turns a quarter of a cell above and below it: what
/// blocks only the lowest directions is then seen by some of them.
class HemisphereLattice {
 public:
  static constexpr int kTileCells = 8;
  static constexpr int kLevels = 3;  ///< cells, quarters, sixteenths
  /// @param side  multiple of 4
  explicit HemisphereLattice(int side);

  int side() const { return side_; }
  int cells() const { return side_ * side_; }
  int tiles() const { return cells() / kTileCells; }
  /// Of a sample of a level, sr.
  float solid_angle(int level) const { return solid_angle_[level]; }
  /// Sample i < cells() * 4^level of a level; its quarters are samples 4 i .. 4 i + 3 of the next.
  const glm::vec3& direction(int level, int i) const { return directions_[level][i]; }
  /// Place of sample i on the square of side() * 2^level samples a side.
  const std::array<uint16_t, 2>& place(int level, int i) const { return places_[level][i]; }

  /// Contains every sample of the tile, of all levels.
  const ConeList::Cone& tile_cone(int tile) const { return cones_[tile]; }
  /// Every tile's, and the tiles themselves.
  ConeTree cones() const { return all_cones_.tree(); }
  const std::vector<uint16_t>& all_tiles() const { return all_tiles_; }

 private:
  int side_;
  std::array<float, kLevels> solid_angle_;
  std::array<std::vector<glm::vec3>, kLevels> directions_;
  std::array<std::vector<std::array<uint16_t, 2>>, kLevels> places_;
  std::vector<ConeList::Cone> cones_;
  ConeList all_cones_;
  std::vector<uint16_t> all_tiles_;
};

/// The unit square mapped with equal areas to the hemisphere z >= 0.
glm::vec3 SquareToHemisphere(float u, float v);

}  // namespace glint
