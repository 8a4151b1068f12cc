#pragma once

#include <cstdint>

#include "common/base/status.h"
#include "common/domain/bake_domain.h"
#include "common/domain/direction_grid.h"
#include "common/store/store.h"
#include "coordinator/executor.h"

namespace glint {

/// What refinement did, for the report. The same for any executor, number of threads and kills.
struct RefinementReport {
  uint32_t rounds = 0;                        ///< of tests
  uint32_t levels = 0;                        ///< that the mesh was coarsened by
  uint64_t tested = 0;                        ///< nodes whose slices were computed to decide
  uint64_t baked = 0;                         ///< of these and of those that had no choice
  uint64_t middles = 0;                       ///< nodes that splitting added
  uint32_t degenerate = 0, non_manifold = 0;  ///< VertexHierarchy's
};

struct RefinementInput {
  const DirectionGrid& grid;
  const BakeSettings& settings;
  Digest bake_key;
  ChunkStore* store;
  Executor* executor;  ///< made for the domain that is refined
  int threads;
};

/// Decides what is baked, by BakeSettings::spatial_tolerance, and sets the domain's nodes: from coarse to
/// fine over the mesh's vertices, and on over halved edges, a node is tested where vertices around it turned
/// out badly predicted, or see other things than it does. Tested means that its slices are computed
/// (ProbeRows) and compared with those predicted from what is baked so far; where they differ too much for
/// the surface it stands for, it is baked. Errors: the executor's; kIo, kLimit.
Result<RefinementReport> RefineVertices(const RefinementInput& input, BakeDomain* domain);

/// Splits every face in four, `times` times, and bakes every node.
Status SubdivideEvenly(int times, BakeDomain* domain);

}  // namespace glint
