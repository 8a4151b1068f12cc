#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace glint {

/// Geodesic view directions: the icosahedron subdivided `level` times, 10 * 4^level + 2 unit directions in
/// the world frame. Levels are nested: a direction of level l + 1 is one of level l, or the midpoint of an
/// edge of level l. Those up to the base level come first, then level by level those that each adds; within
/// that, indices follow a Morton curve over the octahedral map, so that close directions have close indices
/// (the entries of a sparse row then lie together).
class DirectionGrid {
 public:
  static constexpr int kMaxLevel = 5;
  /// @param level       0 .. kMaxLevel
  /// @param base_level  0 .. level; above that, directions may be left out of tables
  /// (common/archive/nested.h)
  explicit DirectionGrid(int level, int base_level = kMaxLevel);

  int level() const { return level_; }
  int base_level() const { return base_level_; }
  bool nested() const { return base_level_ < level_; }
  uint32_t size() const { return static_cast<uint32_t>(directions_.size()); }
  /// Directions up to a level, which have the indices below this; base_level() <= level <= level().
  static uint32_t SizeOf(int level) { return 10 * (1u << (2 * level)) + 2; }
  const glm::vec3& direction(uint32_t i) const { return directions_[i]; }
  const std::vector<glm::vec3>& directions() const { return directions_; }
  const std::vector<std::array<uint32_t, 3>>& triangles() const { return levels_.back(); }
  /// Triangles of a level, base_level() .. level(). Triangle t has the parent t / 4. Children 0, 1, 2 keep
  /// their parent's corner 0, 1, 2 at the same place; corner i of child c is the midpoint of the parent's
  /// corners c and i, that of child 3 the midpoint of corners i and (i + 1) % 3.
  const std::vector<std::array<uint32_t, 3>>& triangles(int level) const {
    return levels_[static_cast<size_t>(level - base_level_)];
  }
  /// The edge that a direction above the base level halves, in the two triangles of the level before: from
  /// corner `edge` to (edge + 1) % 3.
  struct Midpoint {
    std::array<uint32_t, 2> triangle;
    std::array<uint8_t, 2> edge;
    std::array<uint32_t, 2> ends;
  };
  const Midpoint& midpoint(uint32_t direction) const { return midpoints_[direction - SizeOf(base_level_)]; }

  /// The triangle around a direction and barycentric weights (>= 0, sum 1) of its corners.
  struct Location {
    std::array<uint32_t, 3> index;
    std::array<float, 3> weight;
    uint32_t triangle;
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
  void BuildMidpoints();
  void BuildLocator();
  /// Walks from `triangle` to the one around d; its corner weights (unnormalised) go to `weights`.
  uint32_t Walk(const glm::vec3& d, uint32_t triangle, std::array<float, 4>* weights) const;

  int level_, base_level_;
  std::vector<glm::vec3> directions_;
  std::vector<std::vector<std::array<uint32_t, 3>>> levels_;  ///< triangles from the base level on
  std::vector<Midpoint> midpoints_;                           ///< of directions above the base level
  std::vector<Cell> cells_;                                   ///< of triangles()
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
  return {cells_[*hint].index, {w[0] * scale, w[1] * scale, w[2] * scale}, *hint};
}

}  // namespace glint
