#include "common/render/procedural_sky.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/base/frame.h"

namespace glint {
namespace {

float Smooth(float low, float high, float x) {
  const float t = std::clamp((x - low) / (high - low), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

/// A rectangular light seen from the origin: gnomonic coordinates around its axis, soft edges.
struct SoftBox {
  float azimuth_deg, elevation_deg;        ///< of the axis; azimuth from +X towards +Z
  float half_width, half_height, feather;  ///< tangents of angles
  glm::vec3 radiance;
};

glm::vec3 DirectionOf(float azimuth_deg, float elevation_deg) {
  const float a = azimuth_deg * kPi / 180, e = elevation_deg * kPi / 180;
  return {std::cos(e) * std::cos(a), std::sin(e), std::cos(e) * std::sin(a)};
}

float Coverage(const SoftBox& box, const glm::vec3& d) {
  const glm::vec3 axis = DirectionOf(box.azimuth_deg, box.elevation_deg);
  const float along = glm::dot(d, axis);
  if (along <= 0.05f) return 0;
  const glm::vec3 right = glm::normalize(glm::cross(axis, glm::vec3(0, 1, 0)));
  const float x = std::abs(glm::dot(d, right)) / along;
  const float y = std::abs(glm::dot(d, glm::cross(right, axis))) / along;
  return (1 - Smooth(box.half_width - box.feather, box.half_width + box.feather, x)) *
         (1 - Smooth(box.half_height - box.feather, box.half_height + box.feather, y));
}

/// A dark room with a large warm key, a cool strip, a rim light behind and a faint ceiling.
glm::vec3 Studio(const glm::vec3& d) {
  static const std::array<SoftBox, 4> kBoxes{{{35, 42, 0.55f, 0.40f, 0.05f, {14.0f, 12.4f, 10.2f}},
                                              {-75, 18, 0.14f, 0.85f, 0.03f, {4.2f, 5.3f, 7.0f}},
                                              {170, 28, 0.30f, 0.18f, 0.03f, {9.0f, 8.6f, 8.2f}},
                                              {100, 5, 0.20f, 0.55f, 0.04f, {1.6f, 1.1f, 0.8f}}}};
  const glm::vec3 wall =
      glm::mix(glm::vec3(0.05f, 0.045f, 0.04f), glm::vec3(0.16f, 0.17f, 0.19f), Smooth(-0.4f, 0.9f, d.y));
  const float ceiling = Smooth(0.90f, 0.97f, d.y);
  glm::vec3 radiance = wall + ceiling * glm::vec3(0.9f, 0.9f, 0.95f);
  for (const SoftBox& box : kBoxes) radiance = glm::mix(radiance, box.radiance, Coverage(box, d));
  return radiance;
}

/// A low sun over a dark sea: red at the horizon towards the sun, blue overhead, two banks of cloud.
glm::vec3 Sunset(const glm::vec3& d) {
  static const glm::vec3 kSun = DirectionOf(-50, 9);
  constexpr float kSunRadius = 0.022f;  // rad; larger than the real one, so that coarse maps still show it
  const float towards = glm::dot(d, kSun);
  const float angle = std::acos(std::clamp(towards, -1.0f, 1.0f));
  const float glow = std::pow(std::max(0.0f, 0.5f + 0.5f * towards), 6.0f);

  const glm::vec3 zenith(0.10f, 0.19f, 0.42f), horizon(0.75f, 0.42f, 0.28f), warm(3.0f, 1.1f, 0.35f);
  const float height = std::max(d.y, 0.0f);
  glm::vec3 sky = glm::mix(horizon, zenith, 1 - std::exp(-4.5f * height));
  sky += warm * glow * std::exp(-5 * height);
  const float azimuth = std::atan2(d.z, d.x);
  const float bank = Smooth(0.1f, 0.9f, std::sin(3 * azimuth + 1) * std::sin(azimuth - 0.4f)) *
                     Smooth(0.10f, 0.16f, d.y) * (1 - Smooth(0.22f, 0.34f, d.y));
  sky = glm::mix(sky, glm::vec3(0.55f, 0.33f, 0.34f) + warm * glow * 0.6f, 0.7f * bank);
  sky += glm::vec3(900, 560, 260) * (1 - Smooth(kSunRadius * 0.85f, kSunRadius * 1.15f, angle));
  sky += glm::vec3(6.0f, 3.0f, 1.1f) * std::exp(-angle / 0.08f);

  const glm::vec3 sea = glm::vec3(0.03f, 0.045f, 0.06f) + warm * 0.12f * glow;
  return glm::mix(sea, sky, Smooth(-0.012f, 0.012f, d.y));
}

glm::vec3 Uniform(const glm::vec3&) { return glm::vec3(1); }

}  // namespace

SkyFunction FindProceduralSky(const std::string& name) {
  if (name == "studio") return Studio;
  if (name == "sunset") return Sunset;
  if (name == "uniform") return Uniform;
  return nullptr;
}

}  // namespace glint
