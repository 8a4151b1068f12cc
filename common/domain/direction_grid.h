#pragma once

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
  Location Locate(const glm::vec3& direction, uint32_t* hint) const {
    float w[3];
    *hint = Walk(direction, *hint, w);
    return Normalize(*hint, w);
  }

  /// Level with exactly `directions` directions, or -1.
  static int LevelOf(uint32_t directions);

 private:
  void BuildLocator();
  /// The triangle and its corner weights, clamped to >= 0 and scaled to sum 1.
  Location Normalize(uint32_t triangle, const float* weights) const;
  /// Walks from `triangle` to the one around d; its corner weights (unnormalised) go to `weights` unless
  /// null.
  uint32_t Walk(const glm::vec3& d, uint32_t triangle, float* weights) const;

  int level_;
  std::vector<glm::vec3> directions_;
  std::vector<std::array<uint32_t, 3>> triangles_;
  std::vector<std::array<glm::vec3, 3>>
      edge_normals_;                                 ///< per triangle, scaled so that weights come out by dot
  std::vector<std::array<uint32_t, 3>> neighbours_;  ///< across the edge opposite to corner i
  std::vector<uint32_t> start_;                      ///< octahedral cell -> triangle to start the walk from
  int cells_ = 0;
};

}  // namespace glint
