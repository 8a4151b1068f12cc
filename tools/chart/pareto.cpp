#include "tools/chart/pareto.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace glint::chart {

std::vector<bool> ParetoFront(std::span<const CostError> points) {
  std::vector<size_t> order;
  for (size_t i = 0; i < points.size(); ++i) {
    if (std::isfinite(points[i].cost) && std::isfinite(points[i].error)) order.push_back(i);
  }
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return points[a].cost != points[b].cost ? points[a].cost < points[b].cost
                                            : points[a].error < points[b].error;
  });
  // From cheap to dear: a point is on the front if it is better than all cheaper ones, or equal to the last
  // that was.
  std::vector<bool> on_front(points.size(), false);
  CostError best{0, std::numeric_limits<double>::infinity()};
  for (const size_t i : order) {
    const CostError& p = points[i];
    const bool equal = p.cost == best.cost && p.error == best.error;
    if (p.error < best.error || equal) {
      on_front[i] = true;
      best = p;
    }
  }
  return on_front;
}

}  // namespace glint::chart
