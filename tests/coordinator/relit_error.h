#pragma once

#include <vector>

#include "common/archive/archive.h"
#include "common/base/status.h"
#include "common/render/environment.h"
#include "common/render/view.h"
#include "common/scene/scene.h"

namespace glint {

struct RelitOptions {
  int views = 8, size = 96;  ///< pictures, square
  int samples = 128;         ///< of the reference, a pixel
  int threads = 0;
};

/// View i: from all around, by turns from low and from high, while the environment turns faster.
View OrbitView(const std::vector<glm::vec3>& positions, int i, int size);

/// Relative error of an archive's pictures from OrbitViews against the path tracer on the archive's lobes:
/// root of the mean over views, covered pixels and channels of (picture - truth)^2 / ((picture^2 + truth^2) /
/// 2 + epsilon^2), epsilon a tenth of the picture's mean. The reference's noise is taken out.
Result<double> RelitError(const Scene& scene, const Archive& archive, const Environment& environment,
                          const RelitOptions& options);

}  // namespace glint
