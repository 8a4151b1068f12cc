#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "common/base/rng.h"
#include "common/domain/bake_domain.h"
#include "common/lobes/slice_sampler.h"
#include "common/scene/ray_scene.h"
#include "worker/light_groups.h"
#include "worker/slice_encoder.h"
#include "worker/surface_vertices.h"
#include "worker/visible_parts.h"

namespace glint {

/// Where a slice is gathered: a bake vertex, or a point inside a face.
struct SlicePoint {
  VertexSide side;
  uint32_t shape = 0;       ///< index into the domain's
  uint32_t vertex = kNone;  ///< row of the bake vertex; kNone: inside a face
};

/// A ray drawn from a lobe, followed through the scene until it leaves.
struct FanPath {
  glm::vec3 direction{0};  ///< of its first piece, unit
  Hit hit;                 ///< of its first piece
  bool leaves = true;      ///< false: it starts under the faces around, where gathering has no samples
  int layer = -1;          ///< reflections after the first until it left the scene; -1: it did not in time
  glm::vec3 beta{1};       ///< product of those reflections' weights
  glm::vec3 escape{0};     ///< direction in which it left, unit
};

/// Paths drawn from one BRDF lobe above the surface, or from the diffuse lobe. A path's light, times the
/// lobe's weight, is an unbiased sample of the lobe's part of the slice.
struct PathFan {
  SliceLobe lobe;  ///< as it is read out whole: what stored lobes are relative to
  std::vector<FanPath> paths;
};

/// What a path's random numbers are for: points of a low-discrepancy sequence from `offset` on draw its first
/// direction, a stream of the fan's own the rest.
struct FanSeed {
  uint64_t seed;
  uint32_t slice, fan;
  glm::vec2 offset;  ///< in [0, 1)^2
};

/// Traces fans by the lobes of the domain's BRDFs, as `glint reference --brdf lobes` traces paths: the truth
/// that slices are tested by. Thread-safe.
class PathFanTracer {
 public:
  static constexpr int kDiffuse = -1;  ///< the diffuse lobe's slot

  /// @param last_layer  paths with more reflections after the first than this are given up
  PathFanTracer(const BakeDomain& domain, const RayScene& rays, int last_layer);

  /// A bake vertex, as the bake gathers there.
  /// @param row  of the bake vertex
  SlicePoint AtVertex(uint32_t row, bool back) const;
  bool used(uint32_t row) const { return surface_.used(row); }
  const SliceSampler& sampler(uint32_t shape) const { return samplers_[shape]; }

  /// @param wo     unit, side.normal . wo > 0
  /// @param slot   lobe of the point's shape, or kDiffuse
  /// @param count  paths; fewer if hardly any of the lobe lies above the surface
  void Trace(const SlicePoint& point, const glm::vec3& wo, int slot, int count, const FanSeed& seed,
             PathFan* fan) const;

 private:
  void Start(const SlicePoint& point, const glm::vec3& wo, int slot, int count, const glm::vec2& offset,
             PathFan* fan) const;
  void MeetFirst(const SlicePoint& point, PathFan* fan) const;
  void Follow(CounterRng* rng, FanPath* path) const;

  const BakeDomain& domain_;
  const RayScene& rays_;
  const int last_layer_;
  const SurfaceVertices surface_;
  const std::vector<SliceSampler> samplers_;  ///< of the domain's shapes
};

/// Direction drawn with density cos / pi about a unit normal; u in (0, 1)^2.
glm::vec3 SampleCosine(const glm::vec3& normal, const glm::vec2& u);

/// Moments of a fan's direct light, as gathering takes them: over paths that leave the surface. Nothing is
/// visible where none does.
DirectMoments DirectMomentsOf(const PathFan& fan);
/// The parts that the slice is stored as.
VisibleParts DirectPartsOf(const PathFan& fan, const ReadOut& read_out);
/// Light that comes after `layer` further reflections, and how many paths leave the surface: what it is
/// relative to.
struct FanLight {
  LightSamples samples;
  double leaving = 0;

  IndirectMoments Moments() const;
};
FanLight IndirectLightOf(const PathFan& fan, int layer);

}  // namespace glint
