#include "common/render/view.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"

namespace glint {
namespace {

/// `v` made unit, or `fallback` where it has no direction.
glm::vec3 UnitOr(const glm::vec3& v, const glm::vec3& fallback) {
  const float length = glm::length(v);
  return length > 1e-12f && std::isfinite(length) ? v / length : fallback;
}

}  // namespace

PrimaryRays::PrimaryRays(const View& view)
    : eye_(view.camera.eye),
      forward_(UnitOr(view.camera.forward, {0, 0, -1})),
      width_(static_cast<float>(std::max(1, view.width))),
      height_(static_cast<float>(std::max(1, view.height))) {
  // Looking straight along `up` leaves the roll open: any frame around the view direction then serves.
  const glm::vec3 across = glm::cross(forward_, UnitOr(view.camera.up, {0, 1, 0}));
  right_ = glm::length(across) > 1e-5f ? glm::normalize(across) : Frame::FromNormal(forward_).t;
  up_ = glm::cross(right_, forward_);
  scale_y_ = std::tan(0.5f * view.camera.vertical_fov);
  scale_x_ = scale_y_ * width_ / height_;
}

glm::vec3 PrimaryRays::Direction(float x, float y) const {
  const float across = (2.0f * x / width_ - 1.0f) * scale_x_;
  const float above = (1.0f - 2.0f * y / height_) * scale_y_;
  return glm::normalize(forward_ + across * right_ + above * up_);
}

}  // namespace glint
