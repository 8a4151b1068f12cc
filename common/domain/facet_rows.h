#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/domain/bake_domain.h"

namespace glint {

/// A point between nodes is interpolated from at most this many rows.
inline constexpr int kMaxPointRows = 3 * static_cast<int>(kMaxNodeRows);

/// Which rows answer, with which weights, at any place of the surface: those of the corners of the facet
/// around it. Corners often share rows; each is listed once. Thread-safe.
class FacetRows {
 public:
  explicit FacetRows(const BakeDomain& domain);

  /// A row and its weights at the facet's corners.
  struct Row {
    uint32_t row;
    std::array<float, 3> corner;

    float At(const std::array<float, 3>& weight) const {
      return weight[0] * corner[0] + weight[1] * corner[1] + weight[2] * corner[2];
    }
  };
  /// Rows of the facet around a place, at most kMaxPointRows; none where nothing is baked around. `weight`:
  /// of the triangle's corners, becomes that of the facet's.
  std::span<const Row> Locate(uint32_t triangle, std::array<float, 3>* weight) const {
    const uint32_t part = facets_->Locate(triangle, weight);
    return {rows_.data() + first_[part], first_[part + 1] - first_[part]};
  }

 private:
  void AddFacet(const BakeDomain& domain, const std::array<uint32_t, 3>& corners);

  const FacetTree* facets_;
  std::vector<size_t> first_;  ///< of each facet or triangle, and the end
  std::vector<Row> rows_;
};

}  // namespace glint
