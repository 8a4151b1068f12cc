#include "common/domain/facet_rows.h"

#include <algorithm>

namespace glint {

FacetRows::FacetRows(const BakeDomain& domain) : facets_(&domain.nodes.facets) {
  const FacetTree& facets = domain.nodes.facets;
  const size_t parts = facets.unsplit() ? domain.triangles.size() : facets.parts();
  first_.reserve(parts + 1);
  for (uint32_t part = 0; part < parts; ++part) {
    first_.push_back(rows_.size());
    if (facets.unsplit()) {
      AddFacet(domain, domain.triangles[part]);
    } else if (facets.is_facet(part)) {
      AddFacet(domain, facets.corners(part));
    }
  }
  first_.push_back(rows_.size());
}

void FacetRows::AddFacet(const BakeDomain& domain, const std::array<uint32_t, 3>& corners) {
  const auto begin = static_cast<std::ptrdiff_t>(rows_.size());
  for (size_t i = 0; i < 3; ++i) {
    if (domain.nodes.every_vertex()) {
      Row row{corners[i], {0, 0, 0}};
      row.corner[i] = 1;
      rows_.push_back(row);
      continue;
    }
    for (const RowWeight& w : domain.nodes.RowsOf(corners[i])) {
      auto row =
          std::find_if(rows_.begin() + begin, rows_.end(), [&](const Row& r) { return r.row == w.row; });
      if (row == rows_.end()) row = rows_.insert(rows_.end(), {w.row, {0, 0, 0}});
      row->corner[i] += w.value();
    }
  }
}

}  // namespace glint
