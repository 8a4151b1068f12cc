#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/base/status.h"
#include "common/domain/facet_tree.h"

namespace glint {

struct BakeDomain;

/// A row of the tables and its part in a predicted slice, of kWholeWeight.
struct RowWeight {
  uint32_t row = 0;
  uint16_t weight = 0;

  float value() const { return static_cast<float>(weight) / 65535.0f; }
};
inline constexpr uint32_t kWholeWeight = 65535;

/// A node is predicted from at most this many rows.
inline constexpr uint32_t kMaxNodeRows = 4;

/// Where transfer is known, and what it is elsewhere. Nodes are the surface's vertices and the middles that
/// splitting added (FacetTree). Some are baked: each has a row of the tables. Slices of a node are the
/// weighted interpolation of those of its rows: of its own, or of a few others'. Between nodes slices are
/// interpolated over facets. As long as nothing else is said, every vertex is baked and nothing is split.
struct BakeNodes {
  std::vector<uint32_t> splits;  ///< elements, in order (FacetTree)
  std::vector<uint32_t> rows;    ///< node of each row, ascending
  std::vector<uint32_t> first;   ///< of each node, and the end: its first of `weights`; empty: every_vertex()
  std::vector<RowWeight> weights;  ///< add up to kWholeWeight for a node that has any
  FacetTree facets;                ///< of the splits

  bool every_vertex() const { return first.empty(); }
  std::span<const RowWeight> RowsOf(uint32_t node) const {
    return std::span(weights).subspan(first[node], first[node + 1] - first[node]);
  }
};

/// Of each vertex the first one that is the same in position, normal, shape, sides and in having a diffuse
/// part: their slices are the same.
std::vector<uint32_t> WeldVertices(const BakeDomain& domain);

/// Nodes in which `splits` are done, and nothing is baked yet. Errors: FacetTree::Make's.
Result<BakeNodes> SplitNodes(const BakeDomain& domain, std::vector<uint32_t> splits);

/// Bytes of an archive's section, and back, for a domain that has all but its nodes. Every index is checked.
/// Bytes: docs/archive-format.md.
std::vector<std::byte> EncodeNodes(const BakeNodes& nodes);
Result<BakeNodes> DecodeNodes(std::span<const std::byte> raw, const BakeDomain& domain, uint64_t rows);

}  // namespace glint
