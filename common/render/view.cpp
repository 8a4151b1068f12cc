#include "common/render/view.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <sstream>

#include "common/base/frame.h"
#include "common/scene/bounds.h"

namespace glint {
namespace {

bool Finite(const glm::vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

std::string Text(const glm::vec3& v) {
  std::ostringstream text;
  text << v.x << ", " << v.y << ", " << v.z;
  return text.str();
}

}  // namespace

Status CheckView(const View& view) {
  const PictureLimits limits;
  const std::string size =
      "picture size " + std::to_string(view.width) + "x" + std::to_string(view.height) + ": ";
  if (view.width < 1 || view.height < 1 || view.width > limits.side || view.height > limits.side)
    return UsageError(size + "each side must be 1 to " + std::to_string(limits.side));
  if (static_cast<uint64_t>(view.width) * static_cast<uint64_t>(view.height) > limits.pixels)
    return UsageError(size + "a picture may have at most " + std::to_string(limits.pixels) +
                      " pixels; make it smaller");
  const Camera& camera = view.camera;
  const std::string name = "camera '" + camera.name + "': ";
  if (!Within(camera.eye, kMaxEye))
    return UsageError(name + "its eye (" + Text(camera.eye) +
                      ") is not a point within 1e17 of the origin; move it closer, or scale the scene down");
  if (!Finite(camera.forward) || !Finite(camera.up))
    return UsageError(name + "its directions are not finite numbers; give others");
  if (!(camera.vertical_fov > 0 && camera.vertical_fov < kPi))
    return UsageError(name + "its vertical field of view is not between 0 and 180 degrees; give another");
  if (!std::isfinite(view.environment_rotation_deg))
    return UsageError("the environment's turn is not a finite number; give another");
  return {};
}

std::optional<glm::vec3> UnitDirection(const glm::vec3& v) {
  // By the largest component first: squares of the others can then neither overflow nor all vanish.
  const float largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!Finite(v) || !(largest > 0)) return std::nullopt;
  return glm::normalize(v / largest);
}

PrimaryRays::PrimaryRays(const View& view)
    : eye_(view.camera.eye),
      forward_(UnitDirection(view.camera.forward).value_or(glm::vec3(0, 0, -1))),
      width_(static_cast<float>(std::max(1, view.width))),
      height_(static_cast<float>(std::max(1, view.height))) {
  // Looking straight along `up` leaves the roll open: any frame around the view direction then serves.
  const glm::vec3 across = glm::cross(forward_, UnitDirection(view.camera.up).value_or(glm::vec3(0, 1, 0)));
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
