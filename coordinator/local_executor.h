#pragma once

#include "coordinator/executor.h"

namespace glint {

/// Runs tasks on threads of this process. kLimit: memory does not hold the tree over the triangles.
Result<std::unique_ptr<Executor>> MakeLocalExecutor(const ExecutorInput& input);

}  // namespace glint
