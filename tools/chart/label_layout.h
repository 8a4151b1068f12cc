#pragma once

#include <span>
#include <string>
#include <vector>

namespace glint::chart {

/// A point of a plot and its name, in pixels of the picture, origin at the lower left.
struct LabelledPoint {
  double x = 0, y = 0;
  double width = 0;    ///< of the text
  bool first = false;  ///< chooses its place before the others
};

/// Where a text goes: its left end and the middle of its height.
struct LabelPlace {
  double x = 0, y = 0;
  bool away = false;  ///< not beside its point: a line should lead to it
};

/// The frame that texts stay in, pixels.
struct LabelFrame {
  double left = 0, bottom = 0, right = 0, top = 0;
  double text_height = 14;
};

/// Places texts one after the other where each overlaps least with points and texts already placed, and near
/// its point. Deterministic.
std::vector<LabelPlace> PlaceLabels(std::span<const LabelledPoint> points, const LabelFrame& frame);

}  // namespace glint::chart
