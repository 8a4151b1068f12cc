#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/base/status.h"

namespace glint {

/// A point of the surface: weights 1 - u - v, u, v of the triangle's corners.
struct SurfacePlace {
  uint32_t triangle = 0;
  float u = 0, v = 0;
};

/// Triangles split at the middles of their edges, again and again, and made conforming: no corner of a facet
/// lies on another facet's edge. Nodes are the surface's vertices and, behind them, the middles in the order
/// in which they came about, so that a node keeps its number when more is split. Splits are a list of
/// elements, each becoming four: element t < triangles is the triangle itself, triangles + 4 k + i is child i
/// of split k, at corner i, or in the middle for i = 3. What is left beside a split element is cut through in
/// two or three; those parts are not elements.
class FacetTree {
 public:
  static constexpr int kMaxDepth = 16;  ///< of splits; so deep, middles are still exact in single precision
  static constexpr uint32_t kMaxNodes = 64'000'000;

  /// A node that is the middle of an edge.
  struct Middle {
    SurfacePlace place;
    uint32_t across;               ///< triangle beyond the surface's edge that it lies on; kNone: on none
    std::array<uint32_t, 2> ends;  ///< of the edge, nodes
  };

  FacetTree() = default;  ///< nothing is split: facets are the triangles
  /// @param welded  of each vertex: the first that is the same in all that counts (WeldVertices)
  /// kBadInput: a split of what is no element, is split already, or lies deeper than kMaxDepth; or one that
  /// leaves neighbours more than one split apart. kLimit: more than kMaxNodes.
  static Result<FacetTree> Make(std::span<const std::array<uint32_t, 3>> triangles,
                                std::span<const uint32_t> welded, std::span<const uint32_t> splits);

  /// The splits, and behind them those that neighbours of split elements need so as to be at most one apart.
  /// Errors as Make's, but for the one about neighbours.
  static Result<std::vector<uint32_t>> Balance(std::span<const std::array<uint32_t, 3>> triangles,
                                               std::span<const uint32_t> welded,
                                               std::vector<uint32_t> splits);

  bool unsplit() const { return corners_.empty(); }
  /// Middles, from node `vertices` on.
  const std::vector<Middle>& middles() const { return middles_; }
  /// Of each middle: the first node in the same place that is the same in all that counts.
  const std::vector<uint32_t>& welded_middles() const { return welded_middles_; }
  /// Facets and what they were parts of; only meaningful where something is split.
  uint32_t parts() const { return static_cast<uint32_t>(corners_.size()); }
  bool is_facet(uint32_t part) const { return child_[part] == kLeaf; }
  const std::array<uint32_t, 3>& corners(uint32_t part) const { return corners_[part]; }

  /// The facet around a place: its number among parts(), or the triangle if nothing is split. `weight`: of
  /// the triangle's corners, becomes that of the facet's.
  uint32_t Locate(uint32_t triangle, std::array<float, 3>* weight) const {
    return unsplit() ? triangle : Descend(triangle, weight);
  }

 private:
  static constexpr uint32_t kLeaf = 0xFFFFFFFFu;
  class Builder;
  uint32_t Descend(uint32_t part, std::array<float, 3>* weight) const;

  std::vector<std::array<uint32_t, 3>> corners_;  ///< of parts: elements, then what conforming cut through
  std::vector<uint32_t> child_;                   ///< of parts: the first one, or kLeaf
  std::vector<uint8_t> cut_;                      ///< of parts: bit i: the edge opposite corner i is halved
  std::vector<Middle> middles_;
  std::vector<uint32_t> welded_middles_;
};

}  // namespace glint
