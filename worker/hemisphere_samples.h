#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "common/base/frame.h"
#include "common/scene/ray_scene.h"
#include "worker/gather_kernel.h"
#include "worker/hit_set.h"
#include "worker/lattice.h"
#include "worker/layer_light.h"
#include "worker/tile_cones.h"

namespace glint {

/// A vertex's lattice in the world.
struct LatticePose {
  const HemisphereLattice& lattice;
  Frame frame;       ///< lattice to world; n is the side's shading normal
  glm::vec3 origin;  ///< of its rays
};

/// Samples of a hit set laid out for the kernels, with room for a layer's light. Buffers are reused.
///
/// A tile is active if it matters to the layer at hand: if something in it is blocked, for layer 0, or sends
/// light, for the others. Slices whose lobes meet no active tile are free, or dark.
class HemisphereSamples {
 public:
  /// Lays `hits` out in tiles; active are the blocked ones.
  void Expand(const HitSet& hits, const HemisphereLattice& lattice);
  /// Sets the light channels from what `light` sends back along every ray that met a surface, and makes
  /// active the tiles where that is at least `dark` in some channel. Where neighbouring cells see unlike
  /// light, two more rays through each take the mean over it.
  /// @return  how many more rays were traced
  uint64_t Shade(const HitSet& hits, const LatticePose& pose, const RayScene& rays, const LayerLight& light,
                 float dark);
  SampleArrays arrays() const;
  /// Laid out, padding included.
  uint32_t samples() const { return count_; }
  bool any_active() const { return !active_.empty(); }
  ConeTree active_cones() const { return active_.tree(); }
  /// Tiles of the active cones, ascending.
  const std::vector<uint16_t>& active_tiles() const { return active_tiles_; }

 private:
  void AddSample(const glm::vec3& direction, float solid_angle, uint8_t outcome, int cell);
  void AddQuarter(const HemisphereLattice& lattice, int quarter, uint8_t outcome);
  void Activate(int tile, const HemisphereLattice& lattice);
  void FindUnlikeCells(const HemisphereLattice& lattice);
  void LookAgain(const LatticePose& pose, const RayScene& rays, const LayerLight& light);
  bool SetLight(int tile, float dark);

  std::vector<float> x_, y_, z_, solid_angle_, blocked_;
  std::vector<float> light_[6];
  std::vector<uint32_t> tile_begin_;
  std::vector<uint8_t> tile_blocked_;
  uint32_t count_ = 0;  ///< samples laid out, padding included

  std::vector<uint32_t> hit_sample_;  ///< of each hit
  std::vector<int32_t> hit_cell_;     ///< -1: of a quarter
  std::vector<uint32_t> tile_hit_;    ///< first hit of each tile, and the end
  std::vector<HitLight> hit_light_;

  std::vector<LightQuery> queries_;
  std::vector<HitLight> answers_;
  std::vector<int32_t> cell_hit_;  ///< over the square with a border: the cell's hit, -1 without
  std::vector<uint8_t> unlike_;    ///< of each hit
  std::vector<Ray> rays_;
  std::vector<Hit> found_;

  ConeList active_;
  std::vector<uint16_t> active_tiles_;
};

}  // namespace glint
