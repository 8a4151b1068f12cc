#pragma once

#include "coordinator/executor.h"

namespace glint {

/// Leaves tasks to whoever runs `glint run-task`: a job array, a person. Publishes a round and, as long as
/// results are missing, ends it with kInterrupted and a message that says what to run; called again once they
/// are there, it goes on.
Result<std::unique_ptr<Executor>> MakeManualExecutor(const ExecutorInput& input);

}  // namespace glint
