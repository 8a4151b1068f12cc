#include "worker/surface_vertices.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace glint {
namespace {

constexpr float kInset = 0.02f;  ///< of the way to the middle of the faces around
constexpr float kTouch = 0.05f;  ///< of the mean distance to the corners around

float CornerAngle(const glm::vec3& a, const glm::vec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

}  // namespace

SurfaceVertices::SurfaceVertices(const BakeDomain& domain, float epsilon)
    : domain_(domain),
      epsilon_(epsilon),
      inset_(domain.vertex_count(), glm::vec3(0)),
      geometric_(domain.vertex_count(), glm::vec3(0)),
      touch_(domain.vertex_count(), 0.0f),
      used_(domain.vertex_count(), 0) {
  std::vector<float> weight(domain.vertex_count(), 0.0f);
  for (const auto& t : domain.triangles) {
    const glm::vec3 p[3] = {domain.positions[t[0]], domain.positions[t[1]], domain.positions[t[2]]};
    const glm::vec3 face = domain.FaceNormal(static_cast<uint32_t>(face_normal_.size()));
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
  for (uint32_t v = 0; v < domain.vertex_count(); ++v) {
    const glm::vec3& n = domain.normals[v];
    const float length = glm::length(geometric_[v]);
    geometric_[v] = length > 0 ? geometric_[v] / length : n;
    if (weight[v] <= 0) continue;
    inset_[v] *= kInset / weight[v];
    inset_[v] -= geometric_[v] * glm::dot(geometric_[v], inset_[v]);
    touch_[v] = std::max(kTouch * touch_[v] / weight[v], 8 * epsilon_);
  }
}

VertexSide SurfaceVertices::side(uint32_t vertex, bool back) const {
  const float sign = back ? -1.0f : 1.0f;
  const glm::vec3 geometric = sign * geometric_[vertex];
  return {domain_.positions[vertex] + inset_[vertex] + epsilon_ * geometric, sign * domain_.normals[vertex],
          geometric};
}

}  // namespace glint
