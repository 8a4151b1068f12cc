#pragma once

#include <span>
#include <vector>

namespace glint::chart {

/// What a point costs (seconds or bytes) and how far it is off; less is better for both.
struct CostError {
  double cost = 0, error = 0;
};

/// For each point whether it is on the Pareto front: no other is at most as large in both and smaller in one.
/// Equal points are on it together. A point with a value that is not finite is never on it and beats none.
std::vector<bool> ParetoFront(std::span<const CostError> points);

}  // namespace glint::chart
