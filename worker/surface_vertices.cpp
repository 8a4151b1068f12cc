#include "worker/surface_vertices.h"

#include <algorithm>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>

namespace glint {
namespace {

constexpr float kInset = 0.02f;  ///< of the way to the middle of the faces around
constexpr float kTouch = 0.05f;  ///< of the mean distance to the corners around

/// In double: products of a tiny or a huge scene's edges leave the range of floats.
float CornerAngle(const glm::dvec3& a, const glm::dvec3& b) {
  return static_cast<float>(std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)));
}

/// How far along `up` a face with unit normal `face` and edges a and b from its corner at 0 lies above
/// `offset`, which is at right angles to `up`; 0 where it lies elsewhere.
float HeightOfFace(const glm::vec3& a, const glm::vec3& b, const glm::vec3& face, const glm::vec3& offset,
                   const glm::vec3& up) {
  constexpr float kSteepest = 0.05f;  // nothing stands on faces that are steeper, or hang over
  const float slope = glm::dot(face, up);
  const glm::vec3 across = glm::cross(up, offset);
  const bool between = glm::dot(across, a) <= 0 && glm::dot(across, b) >= 0;
  return between && slope > kSteepest ? -glm::dot(face, offset) / slope : 0;
}

}  // namespace

SurfaceVertices::SurfaceVertices(const BakeDomain& domain, float epsilon)
    : domain_(domain),
      epsilon_(epsilon),
      inset_(domain.vertex_count(), glm::vec3(0)),
      geometric_(domain.vertex_count(), glm::vec3(0)),
      touch_(domain.vertex_count(), 0.0f),
      rise_(domain.vertex_count(), {0, 0}),
      used_(domain.vertex_count(), 0) {
  AverageCorners();
  for (uint32_t t = 0; t < domain.triangles.size(); ++t) RaiseOverFace(t);
}

void SurfaceVertices::AverageCorners() {
  std::vector<float> weight(domain_.vertex_count(), 0.0f);
  for (const auto& t : domain_.triangles) {
    const glm::vec3 p[3] = {domain_.positions[t[0]], domain_.positions[t[1]], domain_.positions[t[2]]};
    const glm::vec3 face = domain_.FaceNormal(static_cast<uint32_t>(face_normal_.size()));
    face_normal_.push_back(face);
    for (int i = 0; i < 3; ++i) {
      const uint32_t v = t[i];
      used_[v] = 1;
      const glm::vec3 a = p[(i + 1) % 3] - p[i], b = p[(i + 2) % 3] - p[i];
      const float angle = CornerAngle(a, b);
      geometric_[v] += angle * face;
      inset_[v] += angle * (a + b) / 3.0f;
      touch_[v] += angle * 0.5f * (glm::length(a) + glm::length(b));
      weight[v] += angle;
    }
  }
  for (uint32_t v = 0; v < domain_.vertex_count(); ++v) {
    const glm::vec3& n = domain_.normals[v];
    const float length = glm::length(geometric_[v]);
    geometric_[v] = length > 0 ? geometric_[v] / length : n;
    if (weight[v] <= 0) continue;
    inset_[v] *= kInset / weight[v];
    inset_[v] -= geometric_[v] * glm::dot(geometric_[v], inset_[v]);
    touch_[v] = std::max(kTouch * touch_[v] / weight[v], 8 * epsilon_);
  }
}

/// In a hollow the faces around rise above the tangent plane: an origin in it would lie behind them, and see
/// the outside. From the back, it is so on a ridge.
void SurfaceVertices::RaiseOverFace(uint32_t triangle) {
  const auto& t = domain_.triangles[triangle];
  for (size_t i = 0; i < 3; ++i) {
    const uint32_t v = t[i];
    const glm::vec3& p = domain_.positions[v];
    const float height =
        HeightOfFace(domain_.positions[t[(i + 1) % 3]] - p, domain_.positions[t[(i + 2) % 3]] - p,
                     face_normal_[triangle], inset_[v], geometric_[v]);
    rise_[v][0] = std::max(rise_[v][0], height);
    rise_[v][1] = std::max(rise_[v][1], -height);
  }
}

VertexSide SurfaceVertices::side(uint32_t vertex, bool back) const {
  const float sign = back ? -1.0f : 1.0f;
  const glm::vec3 geometric = sign * geometric_[vertex];
  return {domain_.positions[vertex] + inset_[vertex] + (rise_[vertex][back] + epsilon_) * geometric,
          sign * domain_.normals[vertex], geometric};
}

}  // namespace glint
