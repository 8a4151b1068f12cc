#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace glint {

/// Geodesic view directions: the icosahedron subdivided `level` times, 10 * 4^level + 2 unit directions in
/// the world frame. Indices follow a Morton curve over the octahedral map, so that close directions have
/// close indices (the entries of a sparse row then lie together).
class DirectionGrid {
 public:
  static constexpr int kMaxLevel = 5;
  explicit DirectionGrid(int level);

  int level() const { return level_; }
  uint32_t size() const { return static_cast<uint32_t>(directions_.size()); }
  const glm::vec3& direction(uint32_t i) const { return directions_[i]; }
  const std::vector<glm::vec3>& directions() const { return directions_; }
  const std::vector<std::array<uint32_t, 3>>& triangles() const { return triangles_; }

  /// The triangle around a direction and barycentric weights (>= 0, sum 1) of its corners.
  struct Location {
    std::array<uint32_t, 3> index;
    std::array<float, 3> weight;
  };
  Location Locate(const glm::vec3& direction) const;
  /// The same, walking from triangle *hint, which becomes the one found: fast for directions that come in an
  /// order where each is near the one before. On a common edge of two triangles the hint decides.
  /// @param hint  < triangles().size()
  Location Locate(const glm::vec3& direction, uint32_t* hint) const;

  /// A triangle laid out for look-ups: lane i of the arrays belongs to corner i, lane 3 is 0.
  struct Cell {
    std::array<float, 4> edge_x, edge_y, edge_z;  ///< opposite edge's normal, scaled to give weights by dot
    std::array<float, 4> x, y, z;                 ///< direction
    std::array<uint32_t, 3> index, neighbour;     ///< direction; triangle across the opposite edge
  };
  const Cell& cell(uint32_t triangle) const { return cells_[triangle]; }

  /// Level with exactly `directions` directions, or -1.
  static int LevelOf(uint32_t directions);

 private:
  void BuildLocator();
  /// Walks from `triangle` to the one around d; its corner weights (unnormalised) go to `weights`.
  uint32_t Walk(const glm::vec3& d, uint32_t triangle, std::array<float, 4>* weights) const;

  int level_;
  std::vector<glm::vec3> directions_;
  std::vector<std::array<uint32_t, 3>> triangles_;
  std::vector<Cell> cells_;      ///< of triangles_
  std::vector<uint32_t> start_;  ///< octahedral square -> triangle to start the walk from
  int squares_ = 0;
};

inline uint32_t DirectionGrid::Walk(const glm::vec3& d, uint32_t triangle,
                                    std::array<float, 4>* weights) const {
  // Rounding can make two faces each point at the other for a direction on their common edge; a bounded walk
  // ends there with a weight that is negative by rounding only, which Locate clamps.
  std::array<float, 4>& w = *weights;
  for (int step = 0; step < 4096; ++step) {
    const Cell& cell = cells_[triangle];
    for (int i = 0; i < 4; ++i) w[i] = cell.edge_x[i] * d.x + cell.edge_y[i] * d.y + cell.edge_z[i] * d.z;
    if (std::min(std::min(w[0], w[1]), w[2]) >= -2e-5f) return triangle;
    const int lowest = w[0] < w[1] ? (w[0] < w[2] ? 0 : 2) : (w[1] < w[2] ? 1 : 2);
    triangle = cell.neighbour[lowest];
  }
  w = {1, 0, 0, 0};
  return triangle;
}

inline DirectionGrid::Location DirectionGrid::Locate(const glm::vec3& direction, uint32_t* hint) const {
  std::array<float, 4> w;
  *hint = Walk(direction, *hint, &w);
  for (float& value : w) value = std::max(value, 0.0f);
  const float scale = 1 / (w[0] + w[1] + w[2]);
  return {cells_[*hint].index, {w[0] * scale, w[1] * scale, w[2] * scale}};
}

}  // namespace glint
