#include "coordinator/spatial/visibility_masks.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

#include "common/base/parallel.h"

namespace glint {
namespace {

constexpr uint8_t kBelow = 0, kOutside = 1, kFirstPiece = 2;

/// Points of a golden spiral over the sphere.
std::vector<glm::vec3> Spiral(int count) {
  std::vector<glm::vec3> points;
  for (int i = 0; i < count; ++i) {
    const float z = 1 - (2 * static_cast<float>(i) + 1) / static_cast<float>(count);
    const float phi = 2.39996323f * static_cast<float>(i), r = std::sqrt(1 - z * z);
    points.push_back({r * std::cos(phi), r * std::sin(phi), z});
  }
  return points;
}

/// Of each triangle a number of its connected piece; pieces share numbers where there are more than 254.
std::vector<uint8_t> Pieces(const BakeDomain& domain) {
  std::vector<uint32_t> root(domain.vertex_count());
  std::iota(root.begin(), root.end(), 0);
  auto find = [&](uint32_t v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (const auto& t : domain.triangles)
    for (int i = 1; i < 3; ++i) root[find(t[i])] = find(t[0]);
  std::vector<uint8_t> number(domain.vertex_count(), 0), piece;
  int count = 0;
  for (const auto& t : domain.triangles) {
    uint8_t& own = number[find(t[0])];
    if (own == 0) own = static_cast<uint8_t>(kFirstPiece + count++ % (256 - kFirstPiece));
    piece.push_back(own);
  }
  return piece;
}

}  // namespace

VisibilityMasks::VisibilityMasks(const BakeDomain& domain, const RayScene& rays)
    : domain_(domain), rays_(rays), directions_(Spiral(kDirections)), piece_(Pieces(domain)) {
  Turn();
}

void VisibilityMasks::Turn() {
  const size_t nodes = domain_.vertex_count() + domain_.nodes.facets.middles().size();
  masks_.resize(nodes);
  known_.resize(nodes, 0);
}

void VisibilityMasks::Look(std::span<const uint32_t> nodes, int threads) {
  std::vector<uint32_t> unknown;
  for (const uint32_t node : nodes)
    if (!known_[node]) known_[node] = 1, unknown.push_back(node);
  ParallelFor(unknown.size(), threads, 64, [&](size_t i, int) { masks_[unknown[i]] = Trace(unknown[i]); });
}

VisibilityMasks::Mask VisibilityMasks::Trace(uint32_t node) const {
  const glm::vec3 normal = domain_.Node(node).normal;
  const glm::vec3 origin = domain_.NodePosition(node);
  Mask mask{};
  Ray ray;
  for (int d = 0; d < kDirections; ++d) {
    mask[d] = kBelow;
    if (glm::dot(normal, directions_[d]) <= 0.02f) continue;
    ray.origin = origin + 4 * rays_.epsilon() * normal;
    ray.direction = directions_[d];
    const Hit hit = rays_.Intersect(ray);
    mask[d] = hit.hit() ? piece_[hit.triangle] : kOutside;
  }
  return mask;
}

double VisibilityMasks::Difference(uint32_t a, uint32_t b) const {
  int differ = 0, both = 0;
  for (int d = 0; d < kDirections; ++d) {
    if (masks_[a][d] == kBelow || masks_[b][d] == kBelow) continue;
    ++both;
    differ += masks_[a][d] != masks_[b][d];
  }
  return both > 0 ? static_cast<double>(differ) / both : 1;
}

}  // namespace glint
