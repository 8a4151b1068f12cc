#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "common/base/frame.h"
#include "common/scene/ray_scene.h"
#include "worker/gather.h"
#include "worker/gather_kernel.h"
#include "worker/lattice.h"
#include "worker/layer_light.h"
#include "worker/surface_vertices.h"

namespace glint {

/// Where a hemisphere sample met a surface; enough to look its light up in any layer.
struct SurfaceHit {
  uint32_t triangle;
  uint16_t u, v;  ///< barycentric x 65535
};

/// What one side of a vertex sees along its lattice's directions: traced once, kept between layers. The rays
/// of the finest level only tell how much of their parent is blocked.
struct HitSet {
  /// A sample's outcome. kPartial + 4 * blocked + (leaving - 1): of four finer rays `leaving` (1 .. 4) leave
  /// the surface, and `blocked` of them met another.
  enum Outcome : uint8_t { kFree = 0, kHit = 1, kInvalid = 2, kSplit = 3, kPartial = 4 };

  std::vector<uint8_t> outcome;  ///< of every cell in order; then of the quarters of split cells, in order
  uint32_t cells = 0;
  std::vector<SurfaceHit> hits;  ///< of samples that are at least partly blocked, in their order
  uint64_t rays = 0;
  /// [column * max_lobes + lobe]: sum of that lobe's weights over all samples, the same in every layer; -1
  /// where it is not known yet. Blocks of other columns may be at work at the same time, on other elements.
  mutable std::vector<float> lobe_weights;

  size_t bytes() const {
    return sizeof *this + outcome.capacity() + hits.capacity() * sizeof(SurfaceHit) +
           lobe_weights.capacity() * sizeof(float);
  }
};

/// Samples of a hit set laid out for the kernels, with room for a layer's light. Buffers are reused.
class HemisphereSamples {
 public:
  /// Lays `hits` out in tiles.
  void Expand(const HitSet& hits, const HemisphereLattice& lattice);
  /// Sets the light channels from what `light` sends back along every ray that met a surface; `frame` turns
  /// lattice directions to the world.
  void Shade(const HitSet& hits, const Frame& frame, const LayerLight& light);
  SampleArrays arrays() const;
  const TileCones& cones() const { return cones_; }
  const TileCones& blocked_cones() const { return blocked_cones_; }
  /// Tile of one of the blocked cones.
  uint16_t blocked_tile(int i) const { return blocked_tiles_[i]; }
  int tiles() const { return tiles_; }
  /// Laid out, padding included.
  uint32_t samples() const { return count_; }
  bool any_blocked() const { return blocked_cones_.padded_count > 0; }

 private:
  struct ConeArrays {
    std::vector<float> x, y, z, cos_radius, sin_radius;
    void Clear();
    void Add(const HemisphereLattice::Cone& cone);
    TileCones Pad();
  };
  void AddSample(const glm::vec3& direction, float solid_angle, uint8_t outcome);

  std::vector<float> x_, y_, z_, solid_angle_, blocked_;
  std::vector<float> light_[6];
  std::vector<uint32_t> tile_begin_;
  std::vector<uint32_t> hit_sample_;  ///< of each hit
  std::vector<LightQuery> queries_;
  std::vector<HitLight> answers_;
  uint32_t count_ = 0;  ///< samples laid out, padding included
  std::vector<uint8_t> tile_blocked_;
  std::vector<uint16_t> blocked_tiles_;
  ConeArrays cone_arrays_, blocked_cone_arrays_;
  TileCones cones_{}, blocked_cones_{};
  int tiles_ = 0;
};

/// Traces and keeps hit sets. Thread-safe; what does not fit into the memory bound is traced again when it is
/// needed.
class HitSetCache {
 public:
  HitSetCache(const GatherInput& input, const BakeSettings& settings, uint64_t memory_bytes);
  ~HitSetCache();

  /// The set of one side of a vertex. `keep` owns it where the cache has no room.
  const HitSet& Get(uint32_t vertex, bool back, std::unique_ptr<HitSet>* keep);
  const HemisphereLattice& lattice(uint32_t vertex) const;
  /// Frame of the vertex's lattice: turned about the normal by a random angle that is the vertex's own, so
  /// that neighbouring vertices do not share one aliasing pattern.
  Frame LatticeFrame(uint32_t vertex, bool back) const;
  const SurfaceVertices& surface() const { return surface_; }

 private:
  std::unique_ptr<HitSet> Trace(uint32_t vertex, bool back) const;

  const GatherInput& input_;
  const BakeSettings& settings_;
  SurfaceVertices surface_;
  std::vector<std::unique_ptr<HemisphereLattice>> lattices_;
  std::vector<uint8_t> lattice_of_shape_;
  std::vector<std::atomic<HitSet*>> sets_;
  std::atomic<int64_t> room_;
};

}  // namespace glint
