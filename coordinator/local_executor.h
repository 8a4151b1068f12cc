#pragma once

#include <memory>

#include "common/domain/bake_domain.h"
#include "common/domain/direction_grid.h"
#include "common/scene/ray_scene.h"
#include "common/store/store.h"
#include "coordinator/executor.h"

namespace glint {

/// Runs tasks on threads of this process.
/// @param memory_bytes  bound on what gathering keeps between rounds
std::unique_ptr<Executor> MakeLocalExecutor(const BakeDomain& domain, const RayScene& rays,
                                            const DirectionGrid& grid, const BakeSettings& settings,
                                            const ChunkStore& store, int threads, uint64_t memory_bytes);

/// What besides scene and settings decides a result's bits: program and revision of its gathering, ray
/// tracer, instruction set, compiler with its flags that hold for every build type, C library.
std::string ExecutionId();

}  // namespace glint
