#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "common/lobes/vmf.h"
#include "common/scene/ray_scene.h"
#include "worker/gather.h"
#include "worker/gather_kernel.h"
#include "worker/layer_light.h"
#include "worker/light_groups.h"
#include "worker/slice_encoder.h"
#include "worker/surface_vertices.h"
#include "worker/visible_parts.h"

namespace glint {

/// What a vertex's shared rays tell of a lobe that is sharper than they resolve.
enum class SharedView : uint8_t {
  kFree,     ///< nothing is in its way
  kBlocked,  ///< all of it meets a surface
  kBorder,   ///< a border is too near to say which
};

/// @param sums        over the lobe made as broad as the shared rays resolve
/// @param resolution  SliceLobe::resolution
SharedView ViewOf(const DirectSums& sums, float resolution);

/// A slice's lobe that rays are drawn from.
struct DrawnLobe {
  uint32_t row;  ///< of the bake vertex
  bool back;
  uint16_t column;
  int lobe;  ///< of the slice
  Vmf vmf;   ///< world
};

/// Rays that one lobe of one slice has for itself: directions of equal weight on a spiral over the lobe,
/// turned by an angle that is a function of seed, node, side, column and lobe. As among shared rays, those
/// that do not leave the surface count nowhere. Traced in packets, of the lobe's rays alone, so that no
/// result depends on what else is traced. Buffers are reused.
class LobeRays {
 public:
  LobeRays(const GatherInput& input, const SurfaceVertices& surface, const BakeSettings& settings);

  /// Traces BakeSettings::own_rays of them; half as many where the shared rays see no border and these
  /// neither.
  /// @return  how many were traced
  uint64_t Trace(const DrawnLobe& drawn, SharedView view);
  /// False: most of the lobe lies under the surface, and too few rays leave it to tell more than the shared
  /// ones. What follows is for usable rays alone.
  bool usable() const { return leaving() > 0 && leaving() * kMostForOne >= spiral_; }
  /// How many leave the surface.
  int leaving() const { return static_cast<int>(rays_.size()); }

  /// @param lobe  as it is read out whole
  DirectMoments Direct(const SliceLobe& lobe) const;
  /// What is visible, world; valid until the next call.
  VisibleLight Visible();
  /// Looks up what the layer before sends along them.
  IndirectMoments Indirect(const LayerLight& light);
  /// What it found; the sum is leaving() times the moments. Valid until the next call.
  LightList Light() { return samples_.List(); }

 private:
  static constexpr int kMostForOne = 8;  ///< rays traced for one that leaves

  /// A direction on the spiral: 1 - its cosine to the axis, times kappa; and cosine and sine of its azimuth.
  struct SpiralPoint {
    float depth, x, y;
  };
  using Spiral = std::vector<SpiralPoint>;
  static Spiral MakeSpiral(int points);
  uint64_t TraceSpiral(const DrawnLobe& drawn, const Spiral& spiral);
  bool SeesOneSurface() const;

  const GatherInput& input_;
  const SurfaceVertices& surface_;
  const uint64_t seed_;
  const Spiral all_, half_;
  int spiral_ = 0;         ///< points of the one that was traced last
  std::vector<Ray> rays_;  ///< that leave the surface
  std::vector<Hit> hits_;
  std::vector<LightQuery> queries_;
  std::vector<HitLight> answers_;
  LightSamples samples_;
};

}  // namespace glint
