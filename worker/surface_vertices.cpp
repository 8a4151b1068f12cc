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
      starts_(domain.vertex_count() + domain.nodes.facets.middles().size()) {
  AverageCorners();
  for (uint32_t t = 0; t < domain.triangles.size(); ++t) RaiseOverFace(t);
  for (uint32_t m = 0; m < domain.nodes.facets.middles().size(); ++m) StartFromMiddle(m);
}

void SurfaceVertices::AverageCorners() {
  std::vector<float> weight(domain_.vertex_count(), 0.0f);
  for (const auto& t : domain_.triangles) {
    const glm::vec3 p[3] = {domain_.positions[t[0]], domain_.positions[t[1]], domain_.positions[t[2]]};
    const glm::vec3 face = domain_.FaceNormal(static_cast<uint32_t>(face_normal_.size()));
    face_normal_.push_back(face);
    for (int i = 0; i < 3; ++i) {
      NodeStart& start = starts_[t[i]];
      start.used = true;
      const glm::vec3 a = p[(i + 1) % 3] - p[i], b = p[(i + 2) % 3] - p[i];
      const float angle = CornerAngle(a, b);
      start.geometric += angle * face;
      start.inset += angle * (a + b) / 3.0f;
      start.touch += angle * 0.5f * (glm::length(a) + glm::length(b));
      weight[t[i]] += angle;
    }
  }
  for (uint32_t v = 0; v < domain_.vertex_count(); ++v) {
    NodeStart& start = starts_[v];
    const float length = glm::length(start.geometric);
    start.geometric = length > 0 ? start.geometric / length : domain_.normals[v];
    if (weight[v] <= 0) continue;
    start.inset *= kInset / weight[v];
    start.inset -= start.geometric * glm::dot(start.geometric, start.inset);
    start.touch = std::max(kTouch * start.touch / weight[v], 8 * epsilon_);
  }
}

/// In a hollow the faces around rise above the tangent plane: an origin in it would lie behind them, and see
/// the outside. From the back, it is so on a ridge.
void SurfaceVertices::RaiseOverFace(uint32_t triangle) {
  const auto& t = domain_.triangles[triangle];
  for (size_t i = 0; i < 3; ++i) {
    NodeStart& start = starts_[t[i]];
    const glm::vec3& p = domain_.positions[t[i]];
    const float height =
        HeightOfFace(domain_.positions[t[(i + 1) % 3]] - p, domain_.positions[t[(i + 2) % 3]] - p,
                     face_normal_[triangle], start.inset, start.geometric);
    start.rise[0] = std::max(start.rise[0], height);
    start.rise[1] = std::max(start.rise[1], -height);
  }
}

/// On the edge between two faces, or inside one: both are half-planes there. The surface's own borders are
/// drawn in as at vertices.
void SurfaceVertices::StartFromMiddle(uint32_t middle) {
  const FacetTree::Middle& m = domain_.nodes.facets.middles()[middle];
  NodeStart& start = starts_[domain_.vertex_count() + middle];
  start.used = true;
  const glm::vec3 p = domain_.NodePosition(domain_.vertex_count() + middle);
  const float edge = glm::length(domain_.NodePosition(m.ends[0]) - domain_.NodePosition(m.ends[1]));
  start.touch = std::max(kTouch * 0.5f * edge, 8 * epsilon_);
  const glm::vec3& face = face_normal_[m.place.triangle];
  start.geometric = face;
  if (m.across != kNone) {
    const glm::vec3 sum = face + face_normal_[m.across];
    const float length = glm::length(sum);
    if (length > 1e-6f) start.geometric = sum / length;
    return;
  }
  const SurfacePlace& place = m.place;
  const bool inside = place.u > 0 && place.v > 0 && place.u + place.v < 1;
  if (inside) return;
  const auto& t = domain_.triangles[place.triangle];
  const glm::vec3 centre =
      (domain_.positions[t[0]] + domain_.positions[t[1]] + domain_.positions[t[2]]) / 3.0f - p;
  const float length = glm::length(centre);
  if (length > 0) start.inset = centre * std::min(1.0f, kInset * edge / length);
}

bool SurfaceVertices::Incident(uint32_t triangle, uint32_t row) const {
  const uint32_t node = domain_.RowNode(row);
  if (node >= domain_.vertex_count()) {
    const FacetTree::Middle& m = domain_.nodes.facets.middles()[node - domain_.vertex_count()];
    return triangle == m.place.triangle || triangle == m.across;
  }
  const auto& t = domain_.triangles[triangle];
  return t[0] == node || t[1] == node || t[2] == node;
}

VertexSide SurfaceVertices::side(uint32_t row, bool back) const {
  const float sign = back ? -1.0f : 1.0f;
  const uint32_t node = domain_.RowNode(row);
  const NodeStart& start = starts_[node];
  const glm::vec3 geometric = sign * start.geometric;
  return {domain_.NodePosition(node) + start.inset + (start.rise[back] + epsilon_) * geometric,
          sign * domain_.Node(node).normal, geometric};
}

}  // namespace glint
