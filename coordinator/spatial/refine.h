#pragma once

#include <cstdint>

#include "common/base/status.h"
#include "common/domain/bake_domain.h"
#include "common/domain/bake_settings.h"

namespace glint {

/// What refinement did, for the report. The same for any number of threads.
struct RefinementReport {
  uint32_t levels = 0;  ///< that the mesh was coarsened by
  uint64_t tested = 0;  ///< nodes of which it was looked up what they see
  uint64_t baked = 0;
  uint64_t middles = 0;                       ///< nodes that splitting added
  uint32_t degenerate = 0, non_manifold = 0;  ///< VertexHierarchy's
};

/// Decides what is baked, by BakeSettings::spatial_tolerance, and sets the domain's nodes: from coarse to
/// fine over the mesh's vertices, and on over halved edges. A node is baked where it sees other things than
/// those that it would be predicted from (VisibilityMasks), for so much of the surface that it matters. A
/// function of scene and settings. Errors: kIo, kLimit.
Result<RefinementReport> RefineVertices(const BakeSettings& settings, int threads, BakeDomain* domain);

/// Splits every face in four, `times` times, and bakes every node.
Status SubdivideEvenly(int times, BakeDomain* domain);

}  // namespace glint
