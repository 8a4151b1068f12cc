#pragma once

#include "common/domain/bake_domain.h"
#include "common/render/environment.h"
#include "common/render/view.h"
#include "common/scene/ray_scene.h"

namespace glint {

struct ReferenceOptions {
  int bounces = 2;       ///< indirect bounces: 0 is camera-surface-environment only
  int first_bounce = 0;  ///< leave out paths with fewer indirect bounces (per-layer truth)
  int samples = 64;      ///< paths per pixel, even; two independent halves give the noise estimate
  uint64_t seed = 1;
  bool lobes = false;  ///< trace with the bake's fitted lobes instead of the true BRDF
  /// Off: BRDF samples alone find the light. The same picture with more noise, for checking the tracer
  /// itself.
  bool environment_sampling = true;
  int threads = 0;
};

/// Picture and its own noise.
struct ReferenceResult {
  Picture picture;
  Picture half_difference;   ///< (a - b) / 2 of the two halves: its square estimates each pixel's variance
  double noise_rel_mse = 0;  ///< relMSE of the average itself, eps = 0.1 mean, over covered pixels
  double noise_block4_rel_mse = 0;  ///< the same after 4 x 4 box averaging
};

/// Path tracer: BRDF sampling and environment sampling joined by the balance heuristic; no Russian roulette
/// up to `bounces`; deterministic for any number of threads. Single-sided surfaces are black from behind; all
/// block light. Normals whose mirror direction would fall below the face are bent back (as shared conventions
/// state). kUsage for a view that CheckView refuses and for options out of range, kInterrupted.
Result<ReferenceResult> RenderReference(const Scene& scene, const RayScene& rays, const BakeDomain* domain,
                                        const Environment& environment, const View& view,
                                        const ReferenceOptions& options);

}  // namespace glint
