#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/domain/bake_domain.h"
#include "common/domain/direction_grid.h"
#include "common/round/task.h"
#include "common/store/store.h"

namespace glint {

/// What the rounds of a bake are planned from.
struct PlanInput {
  Digest scene;  ///< Scene::content
  const BakeDomain& domain;
  const DirectionGrid& grid;
  const BakeSettings& settings;
  uint32_t vertices_per_task = 0;    ///< 0: by cost
  uint32_t directions_per_task = 0;  ///< 0: all
  const ChunkStore& store;           ///< of the bake's folder
};

/// The tasks of a layer's round, ordered by first vertex, then first column. Cut by cost: in layer 0 by a
/// guess, then by what the layer before took. What machines took differs from run to run, so the plan is kept
/// in the bake's folder (plans/), for whoever takes the bake up again would else cut it in other places and
/// know none of the finished tasks. kIo: it cannot be written.
/// @param previous  digest of the layer before; zero in layer 0
/// @param before    the tasks of the layer before
Result<std::vector<TaskSpec>> PlanRound(const PlanInput& input, int layer, const Digest& previous,
                                        std::span<const TaskSpec> before);

}  // namespace glint
