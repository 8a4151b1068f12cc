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
#include "worker/surface_vertices.h"

namespace glint {

/// Where a hemisphere sample met a surface; enough to look its light up in any layer.
struct SurfaceHit {
  uint32_t triangle;
  uint16_t u, v;  ///< barycentric x 65535
};

/// What one side of a vertex sees along its lattice's directions: traced once, kept between layers.
struct HitSet {
  enum class Outcome : uint8_t { kFree = 0, kHit = 1, kInvalid = 2, kSplit = 3 };

  int lattice_side = 0;
  std::vector<Outcome>
      outcome;  ///< per cell in order; a split cell's four quarters follow at the end, in cell order
  std::vector<SurfaceHit>
      hits;  ///< of cells and quarters with kHit, in the order in which samples are expanded
  uint64_t rays = 0;

  size_t bytes() const { return sizeof *this + outcome.capacity() + hits.capacity() * sizeof(SurfaceHit); }
};

/// Samples of a hit set laid out for the kernels, with room for a layer's light. Buffers are reused.
class HemisphereSamples {
 public:
  /// Lays `hits` out; `frame` turns lattice directions to the world.
  void Expand(const HitSet& hits, const HemisphereLattice& lattice);
  /// Sets the light channels from light(hit, local direction) -> {alpha r, g, b, moment x, y, z}. Of four
  /// neighbouring cells that all see a surface, and none of them another than its neighbours (else it would
  /// be split), the two on a diagonal are looked up, and the other two have their mean: right to first order,
  /// at half the cost.
  template <class Light>
  void Shade(const HitSet& hits, const Light& light) {
    for (int c = 0; c < 6; ++c) light_[c].assign(x_.size(), 0.0f);
    for (size_t h = 0; h < hits.hits.size(); ++h) {
      if (inner_[h]) continue;
      const uint32_t i = hit_sample_[h];
      const std::array<float, 6> value = light(hits.hits[h], glm::vec3(x_[i], y_[i], z_[i]));
      for (int c = 0; c < 6; ++c) light_[c][i] = value[c];
    }
    for (size_t h = 0; h < hits.hits.size(); ++h) {
      if (!inner_[h]) continue;  // the first of two inner cells; the diagonal is around them
      for (int c = 0; c < 6; ++c)
        light_[c][hit_sample_[h]] = light_[c][hit_sample_[h + 1]] =
            0.5f * (light_[c][hit_sample_[h - 1]] + light_[c][hit_sample_[h + 2]]);
      ++h;
    }
  }
  SampleArrays arrays() const;
  const TileCones& cones() const { return cones_; }
  const TileCones& blocked_cones() const { return blocked_cones_; }
  int tiles() const { return tiles_; }
  bool any_blocked() const { return blocked_cones_.padded_count > 0; }

 private:
  struct ConeArrays {
    std::vector<float> x, y, z, cos_radius, sin_radius;
    void Clear();
    void Add(const HemisphereLattice::Cone& cone);
    TileCones Pad();
  };
  void AddQuad(const HitSet& hits, const HemisphereLattice& lattice, int first_cell, size_t* next_quarter);
  void AddSample(const glm::vec3& direction, float solid_angle, HitSet::Outcome outcome);

  std::vector<float> x_, y_, z_, solid_angle_, blocked_;
  std::vector<float> light_[6];
  std::vector<uint32_t> tile_begin_, hit_sample_;
  std::vector<uint8_t> inner_;  ///< per hit: 1 if its light is the mean of its quad's diagonal
  std::vector<uint8_t> tile_blocked_;
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
