#pragma once

#include <algorithm>
#include <cstdint>

#include "common/base/hash.h"
#include "common/lobes/brdf_table.h"

namespace glint {

inline constexpr int kMaxSliceLobes = 4;  ///< stored for one lobe of a slice's BRDF

enum class GatherMethod : uint8_t {
  kShared = 0,  ///< one shared set of hemisphere rays per bake vertex, reused by all directions and layers
  kPaper = 1,   ///< laurijssen2011: rays drawn from each slice's lobe, in every layer again
};

inline constexpr int kMaxOwnRays = 256;  ///< BakeSettings::own_rays

/// How slices are read out of what was gathered; BakeSettings has the meanings.
struct ReadOut {
  float drop = 0;
  int slice_lobes = 1;
  float lobe_tolerance = 0;
};

/// What a slice's value depends on, besides the scene and the layer before. Part of every task's key.
struct BakeSettings {
  GatherMethod method = GatherMethod::kShared;
  int grid_level = 3;  ///< geodesic level of the view directions; 3: 642 of them
  /// kShared: a slice is left out if interpolating those around it errs by less than this part of its
  /// unoccluded lobe (worker/angular_refinement.h); 0: every direction has its own
  float angular_tolerance = 0;
  int base_level = 1;           ///< kShared, with angular_tolerance: level up to which nothing is left out
  float rays_per_kappa = 3.6f;  ///< kShared: base rays per unit of the vertex's sharpest kappa, at kappa 128
  int min_rays = 256;           ///< kShared: bounds on base rays per vertex
  int max_rays = 4096;
  /// kShared: rays are split in four, this often, where one is blocked and its neighbour is not; 0 .. 2
  int split_levels = 1;
  /// kShared: rays of a slice's own, in each layer, where its lobe is too sharp for the shared ones; 0: none
  int own_rays = 32;
  int paper_rays = 144;  ///< kPaper: rays per lobe, slice and layer
  float drop =
      1.0f / 1024;  ///< relative change of a slice below which it counts as free (layer 0) or nothing
  /// Entries of a table get the fewest bits with which its slices' relative error (rms) is at most this; 0:
  /// 12 bytes
  float bits_tolerance = 0.004f;
  /// kShared: light is read out as up to this many lobes for each of a slice's BRDF, 1 .. kMaxSliceLobes ...
  int slice_lobes = 1;
  /// ... and no more once joining two of them loses less than this. Indirect: the part of their common spread
  /// that lies between them, times the root of their part of the BRDF lobe's light. Direct: a tenth of this
  /// is what a further lobe takes out of the error of the relit slice at least (worker/visible_parts.h)
  float lobe_tolerance = 0.2f;
  uint64_t seed = 1;
  BrdfFitOptions fit;
  /// Relative error of relit radiance up to which slices are predicted from other vertices' instead of baked;
  /// 0: every vertex of the mesh is baked, and no other
  float spatial_tolerance = 0;
  float smallest_edge = 1.0f / 512;  ///< shorter edges are not halved; part of the diagonal of the bounds
  uint32_t max_vertices = 0;         ///< that are baked, in all; worst first. 0: any number
  int subdivide = 0;                 ///< faces are split in four, this often, everywhere

  /// Level up to which each direction has a slice of its own: the grid's, unless some are left out.
  int BaseLevel() const {
    const bool nested = method == GatherMethod::kShared && angular_tolerance > 0;
    return nested ? std::min(base_level, grid_level) : grid_level;
  }
  /// Lobes that a slice can have for each of its BRDF's.
  uint32_t StoredLobes() const {
    return method == GatherMethod::kPaper ? 1 : static_cast<uint32_t>(slice_lobes);
  }
  ReadOut read_out() const { return {drop, static_cast<int>(StoredLobes()), lobe_tolerance}; }
};

/// Feeds every field of the settings.
void HashSettings(const BakeSettings& settings, Hasher* hasher);

/// A block of bake vertices (rows) and grid columns: what a task computes. Slices that do not depend on the
/// view direction go with the block that holds column 0.
struct GatherBlock {
  uint32_t first_vertex = 0, vertices = 0;
  uint32_t first_column = 0, columns = 0;
};

}  // namespace glint
