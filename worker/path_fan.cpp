#include "worker/path_fan.h"

#include <algorithm>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>

#include "common/archive/transfer.h"
#include "common/base/frame.h"
#include "common/domain/scatter_point.h"
#include "common/lobes/vmf.h"
#include "worker/slice_lobes.h"

namespace glint {
namespace {

constexpr int kMaxDrawsPerPath = 16;

/// Point i of the R2 sequence (additive recurrence with the plastic number), moved by `offset`; in (0, 1)^2.
glm::vec2 SequencePoint(const glm::vec2& offset, int i) {
  constexpr double kStepX = 0.7548776662466927, kStepY = 0.5698402909980532;
  const double x = offset.x + kStepX * (i + 1), y = offset.y + kStepY * (i + 1);
  constexpr double kLeast = 0x1p-24, kMost = 1 - 0x1p-24;
  return {static_cast<float>(std::clamp(x - std::floor(x), kLeast, kMost)),
          static_cast<float>(std::clamp(y - std::floor(y), kLeast, kMost))};
}

}  // namespace

glm::vec3 SampleCosine(const glm::vec3& normal, const glm::vec2& u) {
  const float r = std::sqrt(u.x), phi = 2 * kPi * u.y;
  return Frame::FromNormal(normal).ToWorld({r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - u.x)});
}

PathFanTracer::PathFanTracer(const BakeDomain& domain, const RayScene& rays, int last_layer)
    : domain_(domain),
      rays_(rays),
      last_layer_(last_layer),
      surface_(domain, rays.epsilon()),
      samplers_(MakeSliceSamplers(domain.shapes)) {}

SlicePoint PathFanTracer::AtVertex(uint32_t row, bool back) const {
  return {surface_.side(row, back), domain_.Row(row).shape, row};
}

void PathFanTracer::Trace(const SlicePoint& point, const glm::vec3& wo, int slot, int count,
                          const FanSeed& seed, PathFan* fan) const {
  Start(point, wo, slot, count, seed.offset, fan);
  MeetFirst(point, fan);
  CounterRng rng(seed.seed, seed.slice, seed.fan, 0x50617468u);
  for (FanPath& path : fan->paths)
    if (path.leaves) Follow(&rng, &path);
}

/// First directions: those that the lobe sends under the surface are drawn again, since it ends there; at a
/// vertex also those under the faces around, since gathering shares their weight among the others.
void PathFanTracer::Start(const SlicePoint& point, const glm::vec3& wo, int slot, int count,
                          const glm::vec2& offset, PathFan* fan) const {
  const glm::vec3& normal = point.side.normal;
  fan->paths.clear();
  auto add = [&](const glm::vec3& direction) {
    FanPath& path = fan->paths.emplace_back();
    path.direction = direction;
    path.leaves = point.side.Faces(direction);
  };
  if (slot == kDiffuse) {
    fan->lobe = {normal, kCosineKappa};
    for (int i = 0; i < count; ++i) add(SampleCosine(normal, SequencePoint(offset, i)));
    return;
  }
  const SliceSampler& sampler = samplers_[point.shape];
  const UnoccludedSlice slice(sampler, normal, wo);
  const BrdfLobe seen = slice.Seen(sampler, slot);
  fan->lobe = {slice.Direction(seen), seen.kappa};
  const Vmf drawn{slice.Direction(slice.lobes.lobe[slot]), slice.lobes.lobe[slot].kappa};
  for (int i = 0; i < kMaxDrawsPerPath * count && static_cast<int>(fan->paths.size()) < count; ++i) {
    const glm::vec2 u = SequencePoint(offset, i);
    const glm::vec3 direction = SampleVmf(drawn, u.x, u.y);
    if (glm::dot(direction, normal) <= 0) continue;
    if (point.vertex != kNone && !point.side.Faces(direction)) continue;
    add(direction);
  }
}

void PathFanTracer::MeetFirst(const SlicePoint& point, PathFan* fan) const {
  std::vector<Ray> rays(fan->paths.size());
  std::vector<Hit> hits(fan->paths.size());
  for (size_t i = 0; i < rays.size(); ++i) {
    rays[i].origin = point.side.origin;
    rays[i].direction = fan->paths[i].direction;
  }
  rays_.Intersect(rays.data(), hits.data(), static_cast<int>(rays.size()));
  for (size_t i = 0; i < hits.size(); ++i) {
    FanPath& path = fan->paths[i];
    path.hit = hits[i];
    if (point.vertex != kNone && surface_.Touches(point.vertex, hits[i])) path.leaves = false;
  }
}

void PathFanTracer::Follow(CounterRng* rng, FanPath* path) const {
  Hit hit = path->hit;
  glm::vec3 direction = path->direction;
  for (int layer = 0; hit.hit(); ++layer) {
    if (layer == last_layer_) return;
    ScatterPoint point;
    if (!MakeScatterPoint(domain_.positions, domain_.normals, domain_.triangles[hit.triangle],
                          domain_.triangle_double_sided[hit.triangle] != 0, hit, -direction, &point))
      return;
    const DomainBrdf found = BrdfAt(domain_, hit);
    const float u_lobe = rng->Uniform(), u = rng->Uniform(), v = rng->Uniform();
    const BrdfSample scattered = SampleLobes(found.brdf, *found.shape, point.wo_local, u_lobe, u, v);
    if (scattered.weight == glm::vec3(0)) return;
    direction = glm::normalize(point.frame.ToWorld(scattered.wi));
    if (glm::dot(direction, point.face) <= 0) return;
    path->beta *= scattered.weight;
    hit = rays_.Intersect(point.Leaving(direction, rays_.epsilon()));
    if (!hit.hit()) path->layer = layer + 1;
  }
  if (path->layer < 0) path->layer = 0;
  path->escape = direction;
}

DirectMoments DirectMomentsOf(const PathFan& fan) {
  BlockedRays sums;
  for (const FanPath& path : fan.paths)
    if (path.leaves) sums.Add(path.direction, path.hit.hit());
  return sums.Moments(fan.lobe);
}

VisibleParts DirectPartsOf(const PathFan& fan, const ReadOut& read_out) {
  LightSamples samples;
  const auto see = [&] {
    for (const FanPath& path : fan.paths)
      if (path.leaves && !path.hit.hit()) samples.Add(glm::vec3(1), path.direction);
    return VisibleLight{samples.List(), samples.total()};
  };
  return SplitDirect(SelectGatherKernels(), DirectMomentsOf(fan), fan.lobe, read_out, see,
                     [](const glm::dvec3& v) { return v; });
}

IndirectMoments FanLight::Moments() const {
  if (leaving <= 0) return {};
  LightGroup mean = samples.total();
  return (mean *= 1 / leaving).Moments();
}

FanLight IndirectLightOf(const PathFan& fan, int layer) {
  FanLight light;
  for (const FanPath& path : fan.paths) {
    light.leaving += path.leaves;
    if (path.leaves && path.layer == layer) light.samples.Add(path.beta, Luminance(path.beta) * path.escape);
  }
  return light;
}

}  // namespace glint
