#include "worker/vertex_cost.h"

#include <algorithm>

#include "worker/hit_set.h"

namespace glint {
namespace {

// Rough: of one machine and a few scenes. All that hangs on them is how evenly layer 0 is cut.
constexpr double kSecondsPerRay = 2.5e-7;
constexpr double kSecondsPerSlice = 1.5e-6;
constexpr double kQuartersPerCell = 0.5;  ///< rays of split cells, for each cell

double Rays(const BrdfShape& shape, const BakeSettings& settings, double slices) {
  if (settings.method == GatherMethod::kPaper) return slices * settings.paper_rays;
  const double side = LatticeSide(shape, settings);
  return side * side * (1 + kQuartersPerCell * settings.split_levels);
}

}  // namespace

std::vector<float> GuessVertexSeconds(const BakeDomain& domain, const BakeSettings& settings,
                                      uint32_t columns) {
  std::vector<float> of_shape;
  for (const BrdfShape& shape : domain.shapes) {
    const double slices = 0.5 * columns * std::max(shape.lobes, 1);
    of_shape.push_back(
        static_cast<float>(kSecondsPerRay * Rays(shape, settings, slices) + kSecondsPerSlice * slices));
  }
  std::vector<float> seconds(domain.row_count());
  for (uint32_t row = 0; row < domain.row_count(); ++row) {
    const BakeVertex vertex = domain.Row(row);
    seconds[row] = of_shape[vertex.shape] * (vertex.double_sided ? 2.0f : 1.0f);
  }
  return seconds;
}

}  // namespace glint
