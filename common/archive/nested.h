#pragma once

#include <array>
#include <cstdint>

#include "common/domain/direction_grid.h"

namespace glint {

// Slices of a nested grid's directions that a table leaves out. Up to the grid's base level such a slice is
// free (layer 0) or dark (above); beyond, it is predicted: half of each of the two slices at the ends of the
// edge that its direction halves, of which one may be predicted in turn. As every direction has one value,
// whatever is stored around it, levels mix without seams.

/// The most slices that three corners of a triangle lead to: three a level.
inline constexpr int kMaxStandIns = 3 * (DirectionGrid::kMaxLevel + 1);

/// Shares the weight of a direction among the ends of its edge: equally, but nothing to an end under the
/// horizon, where no slice is defined. A midpoint above the horizon has an end above it, too; rounding aside.
/// @param above  above(direction): whether a slice of it is defined
template <class Above>
std::array<float, 2> ShareOfEnds(const std::array<uint32_t, 2>& ends, const Above& above) {
  const bool first = above(ends[0]), second = above(ends[1]);
  if (first == second) return {0.5f, 0.5f};
  return {first ? 1.0f : 0.0f, second ? 1.0f : 0.0f};
}

/// Calls visit(direction, weight, entry) for the slices that the corners of a triangle come down to: those
/// that are stored, and those of the base level, whose entry is null where they are not.
/// @param level, triangle  of the grid
/// @param weight           of its corners
/// @param find             find(direction): its entry, or null
template <class Above, class Find, class Visit>
void VisitStandIns(const DirectionGrid& grid, int level, uint32_t triangle, std::array<float, 3> weight,
                   const Above& above, const Find& find, const Visit& visit) {
  for (; level > grid.base_level(); --level, triangle /= 4) {
    const auto& corner = grid.triangles(level)[triangle];
    const auto& parent = grid.triangles(level - 1)[triangle / 4];
    const int child = static_cast<int>(triangle % 4);
    std::array<float, 3> up{};
    for (int i = 0; i < 3; ++i) {
      if (weight[i] <= 0) continue;
      if (i == child) {
        up[i] += weight[i];
        continue;
      }
      if (const auto* entry = find(corner[i])) {
        visit(corner[i], weight[i], entry);
        continue;
      }
      const int ends[2] = {child < 3 ? child : i, child < 3 ? i : (i + 1) % 3};
      const auto share = ShareOfEnds({parent[ends[0]], parent[ends[1]]}, above);
      for (int e = 0; e < 2; ++e) up[ends[e]] += share[e] * weight[i];
    }
    weight = up;
  }
  const auto& corner = grid.triangles(level)[triangle];
  for (int i = 0; i < 3; ++i)
    if (weight[i] > 0) visit(corner[i], weight[i], find(corner[i]));
}

/// Calls predict(direction, ends, shares) for the directions that a row leaves out beyond the base level,
/// each after its ends.
/// @param above   above(direction): on the side of the vertex that is meant
/// @param stored  stored(direction)
template <class Above, class Stored, class Predict>
void ForEachPredicted(const DirectionGrid& grid, const Above& above, const Stored& stored,
                      const Predict& predict) {
  for (uint32_t d = DirectionGrid::SizeOf(grid.base_level()); d < grid.size(); ++d) {
    if (!above(d) || stored(d)) continue;
    const std::array<uint32_t, 2>& ends = grid.midpoint(d).ends;
    predict(d, ends, ShareOfEnds(ends, above));
  }
}

}  // namespace glint
