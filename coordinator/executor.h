#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/domain/bake_domain.h"
#include "common/domain/direction_grid.h"
#include "common/round/task.h"
#include "common/store/store.h"
#include "coordinator/layer.h"

namespace glint {

/// Tasks that may run at the same time, in any order.
struct Round {
  std::span<const TaskSpec> tasks;
  const Layer* previous = nullptr;  ///< the layer before; null in layer 0
};

/// Runs rounds somewhere. The store, not the executor, says what is finished: tasks whose result is there
/// already are not run again.
class Executor {
 public:
  virtual ~Executor() = default;
  /// Returns when every task has a result, or with kInterrupted once it is asked to stop and the running
  /// tasks are finished. `on_done(index, was_there)` is called once per task, by any thread, one at a time.
  virtual Status Run(const Round& round,
                     const std::function<void(size_t index, bool was_there)>& on_done) = 0;
};

/// What an executor is made from; outlives it.
struct ExecutorInput {
  Digest scene;  ///< Scene::content
  const BakeDomain& domain;
  const DirectionGrid& grid;
  const BakeSettings& settings;
  const ChunkStore& store;
  int threads = 1;
  uint64_t memory_bytes = 0;                   ///< bound on what gathering keeps between rounds
  std::function<bool()> stop = StopRequested;  ///< asked between tasks: whether to end
};
using ExecutorFactory = std::function<Result<std::unique_ptr<Executor>>(const ExecutorInput&)>;

}  // namespace glint
