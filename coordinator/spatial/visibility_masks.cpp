#include "coordinator/spatial/visibility_masks.h"

#include <algorithm>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <numeric>

#include "common/base/parallel.h"

namespace glint {
namespace {

constexpr uint8_t kBelow = 0, kOutside = 1, kInside = 2, kFirstPiece = 3;

constexpr float kGrazing = 0.02f;   ///< cosine; lower directions are not looked at
constexpr float kRise = 4;          ///< of the rays' origins, in epsilons
constexpr float kDepthSteps = 8;    ///< to the octave
constexpr double kLikeDepth = 2.6;  ///< of these: a quarter of the distance
constexpr double kLikeTurn = 0.7;   ///< cosine

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

/// Of each triangle a number of its connected piece; pieces share numbers where there are more than 253.
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
  known_count_ += unknown.size();
  ParallelFor(unknown.size(), threads, 64, [&](size_t i, int) { masks_[unknown[i]] = Trace(unknown[i]); });
}

VisibilityMasks::Mask VisibilityMasks::Trace(uint32_t node) const {
  const BakeVertex vertex = domain_.Node(node);
  const glm::vec3 origin = domain_.NodePosition(node);
  Mask mask{};
  Ray ray;
  for (int d = 0; d < kDirections; ++d) {
    const float cosine = glm::dot(vertex.normal, directions_[d]);
    mask[d] = {kBelow, 0, {}};
    if (std::abs(cosine) <= kGrazing || (cosine < 0 && !vertex.double_sided)) continue;
    ray.origin = origin + std::copysign(kRise * rays_.epsilon(), cosine) * vertex.normal;
    ray.direction = directions_[d];
    mask[d] = Seen(rays_.Intersect(ray), ray.direction);
  }
  return mask;
}

VisibilityMasks::Sight VisibilityMasks::Seen(const Hit& hit, const glm::vec3& direction) const {
  if (!hit.hit()) return {kOutside, 0, {}};
  const glm::vec3 normal = domain_.FaceNormal(hit.triangle);
  const bool back = glm::dot(normal, direction) > 0;
  if (back && !domain_.triangle_double_sided[hit.triangle]) return {kInside, 0, {}};
  Sight sight{piece_[hit.triangle], 0, {}};
  const float depth = kDepthSteps * std::log2(std::max(hit.t / rays_.epsilon(), 1e-6f));
  sight.depth = static_cast<int8_t>(std::clamp(depth - 128, -127.0f, 127.0f));
  for (int c = 0; c < 3; ++c) sight.normal[c] = static_cast<int8_t>(std::lround(127 * normal[c]));
  return sight;
}

double VisibilityMasks::Difference(uint32_t a, uint32_t b) const {
  const Parent other{b, 1};
  return SquareError(a, {&other, 1});
}

double VisibilityMasks::SquareError(uint32_t node, std::span<const Parent> prediction) const {
  double sum = 0;
  int above = 0;
  for (int d = 0; d < kDirections; ++d) {
    if (masks_[node][d].what == kBelow) continue;
    ++above;
    const double wrong = Wrong(node, d, prediction);
    sum += wrong * wrong;
  }
  return above > 0 ? sum / above : 0;
}

double VisibilityMasks::Wrong(uint32_t node, int direction, std::span<const Parent> prediction) const {
  const Sight& seen = masks_[node][direction];
  double other = 0, same = 0, depth = 0;
  glm::dvec3 normal(0);
  for (const Parent& p : prediction) {
    const Sight& s = masks_[p.node][direction];
    if (s.what == kBelow) continue;
    if (s.what != seen.what) {
      other += p.weight;
      continue;
    }
    same += p.weight;
    depth += p.weight * s.depth;
    normal += double{p.weight} * glm::dvec3(s.normal[0], s.normal[1], s.normal[2]);
  }
  if (other + same <= 0) return 0;
  const glm::dvec3 own(seen.normal[0], seen.normal[1], seen.normal[2]);
  const bool alike = std::abs(depth - same * seen.depth) <= kLikeDepth * same &&
                     glm::dot(normal, own) >= kLikeTurn * glm::length(normal) * glm::length(own);
  return (other + (alike ? 0 : kShape * same)) / (other + same);
}

bool VisibilityMasks::Dark(uint32_t node) const {
  const Mask& mask = masks_[node];
  return std::all_of(mask.begin(), mask.end(),
                     [](const Sight& s) { return s.what == kBelow || s.what == kInside; });
}

}  // namespace glint
