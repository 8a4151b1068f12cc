#pragma once

#include <cstdint>

#include "common/base/hash.h"
#include "common/lobes/brdf_table.h"

namespace glint {

enum class GatherMethod : uint8_t {
  kShared = 0,  ///< one shared set of hemisphere rays per bake vertex, reused by all directions and layers
  kPaper = 1,   ///< laurijssen2011: rays drawn from each slice's lobe, in every layer again
};

/// What a slice's value depends on, besides the scene and the layer before. Part of every task's key.
struct BakeSettings {
  GatherMethod method = GatherMethod::kShared;
  int grid_level = 3;           ///< geodesic level of the view directions; 3: 642 of them
  float rays_per_kappa = 3.6f;  ///< kShared: base rays per unit of the vertex's sharpest kappa, at kappa 128
  int min_rays = 256;           ///< kShared: bounds on base rays per vertex
  int max_rays = 8192;
  /// kShared: rays are split in four, this often, where one is blocked and its neighbour is not; 0 .. 2
  int split_levels = 1;
  int paper_rays = 144;  ///< kPaper: rays per lobe, slice and layer
  float drop =
      1.0f / 1024;  ///< relative change of a slice below which it counts as free (layer 0) or nothing
  uint64_t seed = 1;
  BrdfFitOptions fit;
  /// Relative error of relit radiance up to which slices are predicted from other vertices' instead of baked;
  /// 0: every vertex of the mesh is baked, and no other
  float spatial_tolerance = 0;
  float smallest_edge = 1.0f / 512;  ///< shorter edges are not halved; part of the diagonal of the bounds
  uint32_t max_vertices = 0;         ///< that are baked, in all; worst first. 0: any number
  int subdivide = 0;                 ///< faces are split in four, this often, everywhere
};

/// Feeds every field of the settings.
void HashSettings(const BakeSettings& settings, Hasher* hasher);

/// A block of bake vertices (rows) and grid columns: what a task computes. Slices that do not depend on the
/// view direction go with the block that holds column 0.
struct GatherBlock {
  uint32_t first_vertex = 0, vertices = 0;
  uint32_t first_column = 0, columns = 0;
  uint32_t column_step = 1;  ///< only every so-many-th of the columns is computed
};

}  // namespace glint
