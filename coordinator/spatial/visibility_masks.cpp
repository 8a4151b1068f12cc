#include "coordinator/spatial/visibility_masks.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/archive/transfer.h"
#include "common/base/parallel.h"

namespace glint {
namespace {

constexpr float kGrazing = 0.02f;    ///< cosine; lower directions are not looked at
constexpr float kRise = 4;           ///< of the rays' origins, in epsilons
constexpr float kLeastBlur = 0.05f;  ///< weight, of that in the middle of a lobe
/// Weight of views that nobody has from outside: they are still what other surfaces reflect.
constexpr double kHidden = 0.25;

glm::vec3 Mirrored(const glm::vec3& d, const glm::vec3& normal) {
  return 2 * glm::dot(d, normal) * normal - d;
}

float Mean(const glm::vec3& color) { return (color.x + color.y + color.z) / 3; }

/// Geometric mean of a shape's lobes, by their weight, seen from 45 degrees.
float MeanKappa(const BrdfShape& shape) {
  const BrdfSlice slice = LookupSlice(shape, 0.7f);
  float weight = 0, logarithm = 0;
  for (int k = 0; k < slice.lobes; ++k) {
    weight += slice.lobe[k].scale;
    logarithm += slice.lobe[k].scale * std::log(std::max(slice.lobe[k].kappa, 1.0f));
  }
  return weight > 0 ? std::exp(logarithm / weight) : 1;
}

void AddTo(LobeSight* sum, float weight, const LobeSight& sight) {
  sum->open += weight * sight.open;
  sum->light += weight * sight.light;
  sum->onward += weight * sight.onward;
}

LobeSight Scaled(const LobeSight& sight, float factor) {
  return {factor * sight.open, factor * sight.light, factor * sight.onward};
}

double Square(double x) { return x * x; }

}  // namespace

VisibilityMasks::PackedSight VisibilityMasks::PackedSight::Pack(const LobeSight& sight) {
  const auto whole = [](float x, float most) { return static_cast<int>(std::lround(most * x)); };
  PackedSight packed{
      static_cast<uint8_t>(whole(sight.open, 255)), static_cast<uint8_t>(whole(sight.light, 255)), {}};
  for (int c = 0; c < 3; ++c) packed.onward[c] = static_cast<int8_t>(whole(sight.onward[c], 127));
  return packed;
}

LobeSight VisibilityMasks::PackedSight::Unpack() const {
  return {static_cast<float>(open) / 255, static_cast<float>(light) / 255,
          glm::vec3(onward[0], onward[1], onward[2]) / 127.0f};
}

VisibilityMasks::VisibilityMasks(const BakeDomain& domain, const RayScene& rays)
    : domain_(domain), rays_(rays), diffuse_error_(kCosineKappa) {
  for (const BrdfShape& shape : domain.shapes) lobes_.push_back(MakeLobe(shape));
  Turn();
}

VisibilityMasks::Lobe VisibilityMasks::MakeLobe(const BrdfShape& shape) const {
  const float kappa = MeanKappa(shape);
  Lobe lobe{std::vector<std::vector<Lobe::Weight>>(kDirections), SightError(kappa)};
  for (int d = 0; d < kDirections; ++d)
    for (int other = 0; other < kDirections; ++other) {
      const float weight = std::exp(kappa * (glm::dot(directions_[d], directions_[other]) - 1));
      if (other == d || weight >= kLeastBlur) lobe.blur[d].push_back({static_cast<uint8_t>(other), weight});
    }
  return lobe;
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
  Mask mask;
  mask.normal = vertex.normal;
  mask.shape = vertex.shape;
  mask.double_sided = vertex.double_sided;
  const float diffuse = Mean(vertex.diffuse);
  mask.diffuse = diffuse > 0 ? diffuse / (Mean(vertex.specular) + diffuse) : 0;
  Sights seen;
  Ray ray;
  for (int d = 0; d < kDirections; ++d) {
    const float cosine = glm::dot(vertex.normal, directions_[d]);
    if (std::abs(cosine) <= kGrazing || (cosine < 0 && !vertex.double_sided)) continue;
    ray.origin = origin + std::copysign(kRise * rays_.epsilon(), cosine) * vertex.normal;
    ray.direction = directions_[d];
    seen[d] = Seen(rays_.Intersect(ray), ray.direction);
    mask.above[d] = true;
    mask.outside[d] = seen[d].open > 0;
    mask.free = mask.free && mask.outside[d];
    mask.dark = mask.dark && seen[d].open + seen[d].light <= 0;
  }
  if (mask.free) {
    mask.specular.fill(PackedSight::Pack({.open = 1}));
    mask.hemisphere.open = 1;
  } else {
    Blur(seen, &mask);
  }
  return mask;
}

LobeSight VisibilityMasks::Seen(const Hit& hit, const glm::vec3& direction) const {
  if (!hit.hit()) return {.open = 1};
  const glm::vec3 normal = domain_.FaceNormal(hit.triangle);
  const bool back = glm::dot(normal, direction) > 0;
  if (back && !domain_.triangle_double_sided[hit.triangle]) return {};
  const uint32_t corner = domain_.triangles[hit.triangle][0];
  const float light = std::min(Mean(domain_.specular[corner]) + Mean(domain_.diffuse[corner]), 1.0f);
  return {0, light, light * Mirrored(-direction, normal)};
}

void VisibilityMasks::Blur(const Sights& seen, Mask* mask) const {
  LobeSight hemisphere;
  float cosines = 0;
  for (int d = 0; d < kDirections; ++d) {
    if (!mask->above[d]) continue;
    const float cosine = glm::dot(directions_[d], mask->normal);
    LobeSight sum;
    float total = 0;
    for (const Lobe::Weight& w : lobes_[mask->shape].blur[d]) {
      if (!mask->above[w.direction] || cosine * glm::dot(directions_[w.direction], mask->normal) < 0)
        continue;
      AddTo(&sum, w.weight, seen[w.direction]);
      total += w.weight;
    }
    mask->specular[d] = PackedSight::Pack(Scaled(sum, 1 / total));
    AddTo(&hemisphere, std::abs(cosine), seen[d]);
    cosines += std::abs(cosine);
  }
  if (cosines > 0) mask->hemisphere = Scaled(hemisphere, 1 / cosines);
}

bool VisibilityMasks::Answer(const Mask& mask, const glm::vec3& wo, LobeSight* sight) const {
  const int mirrored = directions_.Nearest(Mirrored(wo, mask.normal));
  if (!mask.above[mirrored]) return false;
  *sight = mask.specular[mirrored].Unpack();
  return true;
}

template <class Visit>
double VisibilityMasks::MeanOverViews(const glm::vec3& normal, bool double_sided, const Visit& visit) const {
  double sum = 0, cosines = 0;
  for (int d = 0; d < kDirections; ++d) {
    const float cosine = glm::dot(normal, directions_[d]);
    if (cosine <= 0 && !double_sided) continue;
    sum += std::abs(cosine) * visit(directions_[d], d);
    cosines += std::abs(cosine);
  }
  return cosines > 0 ? sum / cosines : 0;
}

double VisibilityMasks::SquareError(uint32_t node, std::span<const Parent> prediction) const {
  const Mask& own = masks_[node];
  if (own.free &&
      std::all_of(prediction.begin(), prediction.end(), [&](const Parent& p) { return masks_[p.node].free; }))
    return 0;
  double square = 0;
  if (own.diffuse < 1)
    square = Square(1 - own.diffuse) *
             MeanOverViews(own.normal, own.double_sided, [&](const glm::vec3& wo, int d) {
               LobeSight sight, other;
               if (!Answer(own, wo, &sight)) return 0.0;
               SightBlend blend;
               for (const Parent& p : prediction) {
                 const Mask& mask = masks_[p.node];
                 const bool same_side = glm::dot(mask.normal, wo) * glm::dot(own.normal, wo) > 0;
                 if (same_side && Answer(mask, wo, &other)) blend.Add(p.weight, other);
               }
               if (blend.empty() || (sight.open == 1 && blend.free())) return 0.0;
               return (own.outside[d] ? 1 : kHidden) * lobes_[own.shape].error(sight, blend);
             });
  if (own.diffuse > 0) {
    SightBlend blend;
    for (const Parent& p : prediction) blend.Add(p.weight, masks_[p.node].hemisphere);
    square += Square(own.diffuse) * diffuse_error_(own.hemisphere, blend);
  }
  return square;
}

double VisibilityMasks::SquareErrorBetween(uint32_t a, uint32_t b) const {
  const std::array<const Mask*, 2> end = {&masks_[a], &masks_[b]};
  if (end[0]->free && end[1]->free) return 0;
  const auto either = [](const SightError& error, std::array<LobeSight, 2> sights) {
    SightBlend blend;
    for (const LobeSight& s : sights) blend.Add(0.5f, s);
    // What both see turns evenly between them.
    if (sights[0].light > 0 && sights[1].light > 0)
      for (LobeSight& s : sights) s.onward = blend.Onward();
    return 0.5 * (error(sights[0], blend) + error(sights[1], blend));
  };
  const float diffuse = end[0]->diffuse;
  const glm::vec3 sum = end[0]->normal + end[1]->normal;
  const float length = glm::length(sum);
  double square = 0;
  if (diffuse < 1 && length > 0)
    square = Square(1 - diffuse) *
             MeanOverViews(sum / length, end[0]->double_sided, [&](const glm::vec3& wo, int d) {
               std::array<LobeSight, 2> sights;
               if (glm::dot(end[0]->normal, wo) * glm::dot(end[1]->normal, wo) <= 0 ||
                   !Answer(*end[0], wo, &sights[0]) || !Answer(*end[1], wo, &sights[1]) ||
                   (sights[0].open == 1 && sights[1].open == 1))
                 return 0.0;
               const bool outside = end[0]->outside[d] || end[1]->outside[d];
               return (outside ? 1 : kHidden) * either(lobes_[end[0]->shape].error, sights);
             });
  if (diffuse > 0)
    square += Square(diffuse) * either(diffuse_error_, {end[0]->hemisphere, end[1]->hemisphere});
  return square;
}

}  // namespace glint
