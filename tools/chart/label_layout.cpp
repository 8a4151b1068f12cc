#include "tools/chart/label_layout.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace glint::chart {
namespace {

constexpr double kMarker = 7;  ///< half side of what a point covers, pixels
constexpr double kGap = 10;    ///< from a point to a text beside it
constexpr double kRing = 17;   ///< by which each further ring of places is farther away
constexpr int kRings = 9;
constexpr int kAngles = 16;

struct Box {
  double left, bottom, right, top;
};

double Overlap(const Box& a, const Box& b) {
  const double w = std::min(a.right, b.right) - std::max(a.left, b.left);
  const double h = std::min(a.top, b.top) - std::max(a.bottom, b.bottom);
  return w > 0 && h > 0 ? w * h : 0;
}

double Outside(const Box& a, const LabelFrame& frame) {
  const Box inside{frame.left, frame.bottom, frame.right, frame.top};
  return (a.right - a.left) * (a.top - a.bottom) - Overlap(a, inside);
}

/// The box of a text whose nearest edge is `distance` away from the point in the direction of `angle`.
Box BoxAt(const LabelledPoint& p, double angle, double distance, double height) {
  const double c = std::cos(angle), s = std::sin(angle);
  const double x = p.x + c * distance + (c - 1) * 0.5 * p.width;  // left end: right of the point at angle 0
  const double y = p.y + s * (distance + 0.5 * height);
  return {x, y - 0.5 * height, x + p.width, y + 0.5 * height};
}

}  // namespace

std::vector<LabelPlace> PlaceLabels(std::span<const LabelledPoint> points, const LabelFrame& frame) {
  std::vector<Box> taken;
  for (const LabelledPoint& p : points)
    taken.push_back({p.x - kMarker, p.y - kMarker, p.x + kMarker, p.y + kMarker});
  std::vector<size_t> order(points.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_partition(order.begin(), order.end(), [&](size_t i) { return points[i].first; });

  std::vector<LabelPlace> places(points.size());
  for (const size_t i : order) {
    double least = INFINITY;
    Box best{};
    for (int ring = 0; ring < kRings; ++ring) {
      for (int a = 0; a < kAngles; ++a) {
        const Box box = BoxAt(points[i], 2 * M_PI * a / kAngles, kGap + kRing * ring, frame.text_height);
        double cost = 40.0 * ring + a * 1e-3 + 10 * Outside(box, frame);
        for (const Box& other : taken) cost += 4 * Overlap(box, other);
        if (cost >= least) continue;
        least = cost;
        best = box;
        places[i] = {box.left, 0.5 * (box.bottom + box.top), ring > 0};
      }
    }
    taken.push_back(best);
  }
  return places;
}

}  // namespace glint::chart
