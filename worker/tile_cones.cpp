#include "worker/tile_cones.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace glint {

void ConeList::Arrays::Clear() {
  for (auto* a : {&x, &y, &z, &cos_radius, &sin_radius}) a->clear();
}

void ConeList::Arrays::Add(const Cone& cone) {
  x.push_back(cone.axis.x);
  y.push_back(cone.axis.y);
  z.push_back(cone.axis.z);
  cos_radius.push_back(cone.cos_radius);
  sin_radius.push_back(cone.sin_radius);
}

void ConeList::Arrays::Pad() {
  while (x.size() % kLanes != 0) Add({{0, 0, 1}, -4, 0});
}

TileCones ConeList::Arrays::view() const {
  return {x.data(), y.data(), z.data(), cos_radius.data(), sin_radius.data(), static_cast<int>(x.size())};
}

void ConeList::Clear() {
  tiles_.Clear();
  groups_.Clear();
}

void ConeList::Add(const Cone& cone) { tiles_.Add(cone); }

void ConeList::Finish() {
  const size_t count = tiles_.x.size();
  for (size_t first = 0; first < count; first += kLanes)
    groups_.Add(Bound(first, std::min(first + kLanes, count)));
  tiles_.Pad();
  groups_.Pad();
}

ConeList::Cone ConeList::Bound(size_t first, size_t end) const {
  const Arrays& t = tiles_;
  glm::vec3 sum(0);
  for (size_t i = first; i < end; ++i) sum += glm::vec3(t.x[i], t.y[i], t.z[i]);
  const float length = glm::length(sum);
  const glm::vec3 axis = length > 1e-3f ? sum / length : glm::vec3(0, 0, 1);
  float cosine = 1;
  for (size_t i = first; i < end; ++i) {
    const float c = std::clamp(glm::dot(axis, glm::vec3(t.x[i], t.y[i], t.z[i])), -1.0f, 1.0f);
    // Farthest direction of the cone: angle + radius, but no farther than the opposite.
    const float farthest =
        c + t.cos_radius[i] < 0 ? -1.0f : c * t.cos_radius[i] - std::sqrt(1 - c * c) * t.sin_radius[i];
    cosine = std::min(cosine, farthest);
  }
  cosine = std::max(cosine - 1e-6f, -1.0f);
  return {axis, cosine, std::sqrt(1 - cosine * cosine)};
}

}  // namespace glint
