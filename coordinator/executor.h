#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "common/archive/archive.h"
#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/domain/bake_settings.h"

namespace glint {

/// One task: a pure function of what its key hashes. Its result is a chunk in the store.
struct TaskSpec {
  Digest key;
  int layer = 0;
  GatherBlock block;
};

/// Tasks that may run at the same time, in any order.
struct Round {
  std::span<const TaskSpec> tasks;
  const LayerViews* previous = nullptr;  ///< tables of the layer before; null in layer 0
};

/// Runs rounds somewhere. The store, not the executor, says what is finished: tasks whose result is there
/// already are not run again.
class Executor {
 public:
  virtual ~Executor() = default;
  /// Returns when every task has a result, or with kInterrupted once StopRequested() and the running tasks
  /// are finished. `on_done(index, was_there)` is called once per task, by any thread, one at a time.
  virtual Status Run(const Round& round,
                     const std::function<void(size_t index, bool was_there)>& on_done) = 0;
};

}  // namespace glint
