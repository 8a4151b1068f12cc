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
#include "worker/lattice.h"
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
  /// kPair + 2 * down + hit: two quarters side by side, or one over the other, that have one ray between
  /// them, or their cell's, are one sample in the middle; of its two places the first has this, the second
  /// kInvalid.
  enum Outcome : uint8_t { kFree = 0, kHit = 1, kInvalid = 2, kSplit = 3, kPartial = 4, kPair = 24 };

  std::vector<uint8_t> outcome;  ///< of every cell in order; then of the quarters of split cells, in order
  uint32_t cells = 0;
  std::vector<SurfaceHit> hits;  ///< of samples that are at least partly blocked, in their order
  uint64_t rays = 0;
  /// [column * max_lobes + lobe]: sum of that lobe's weights over all samples, the same in every layer, and
  /// behind those the cosine's; -1 where it is not known yet. Blocks of other columns may be at work at the
  /// same time, on other elements.
  mutable std::vector<float> lobe_weights;

  size_t bytes() const {
    return sizeof *this + outcome.capacity() + hits.capacity() * sizeof(SurfaceHit) +
           lobe_weights.capacity() * sizeof(float);
  }
};

/// Of the lobes that reflect anything to speak of, at least 1.
float SharpestKappa(const BrdfShape& shape);
/// Side of the lattice that serves a shape; its square is the number of base rays of a vertex.
int LatticeSide(const BrdfShape& shape, const BakeSettings& settings);

/// Traces and keeps hit sets. Thread-safe; what does not fit into the memory bound is traced again when it is
/// needed.
class HitSetCache {
 public:
  HitSetCache(const GatherInput& input, const BakeSettings& settings, uint64_t memory_bytes);
  ~HitSetCache();

  /// The set of one side of a bake vertex. `keep` owns it where the cache has no room.
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
  std::vector<std::atomic<HitSet*>> sets_;  ///< [2 row + side]
  std::atomic<int64_t> room_;
};

}  // namespace glint
