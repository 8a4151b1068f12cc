#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/queue/task_queue.h"
#include "common/round/quarantine.h"
#include "common/round/task.h"
#include "coordinator/cluster_executor.h"

namespace glint {

/// What has become of a round's tasks, as the bake's folder says.
class RoundLedger {
 public:
  virtual ~RoundLedger() = default;
  virtual bool Finished(size_t task) = 0;
  virtual std::optional<QuarantineRecord> GivenUp(size_t task) = 0;
};

/// A round as the queue is told of it.
struct QueuedRound {
  Digest manifest;
  std::span<const TaskSpec> tasks;  ///< they cover the surface in the order of its vertices
};

/// Sees rounds of one bake through: puts their tasks into the queue, looks at what is finished, and tells the
/// queue again what it has lost. Knows time, tasks and queue only through what it is given.
class RoundDispatcher {
 public:
  /// @param bake   its `shards` are chosen here
  /// @param queue  outlives this
  RoundDispatcher(TaskPublisher* queue, const QueuedBake& bake, const ClusterOptions& options,
                  std::function<bool()> stop)
      : queue_(*queue), bake_(bake), options_(options), stop_(std::move(stop)) {}

  using OnDone = std::function<void(size_t task, bool was_there)>;
  /// Returns when every task is finished. kInterrupted: asked to stop; kInternal: workers gave tasks up, and
  /// nothing else is left to do.
  /// @param open  indices of the tasks that were not finished before
  Status Run(const QueuedRound& round, std::vector<size_t> open, RoundLedger* ledger, OnDone on_done);

  // Run() in steps: Begin, and then Look again after each Pause, until it says that every task is finished.
  void Begin(const QueuedRound& round, std::vector<size_t> open, RoundLedger* ledger, OnDone on_done);
  Result<bool> Look();
  double Pause() const { return pause_; }  ///< seconds

  /// Takes the bake out of the queue.
  Status Close() { return queue_.Close(bake_.bake); }

 private:
  void Collect();
  Status Feed(const std::optional<QueueState>& state);
  Result<std::vector<size_t>> NotGivenUp() const;
  Status Publish(uint64_t room);
  void Tell(const Status& queue_status);
  void Watch(const Result<std::optional<QueueState>>& state);

  TaskPublisher& queue_;
  QueuedBake bake_;
  const ClusterOptions options_;
  const std::function<bool()> stop_;
  QueuedRound round_;
  std::vector<size_t> open_;  ///< tasks that are not finished
  RoundLedger* ledger_ = nullptr;
  OnDone on_done_;
  std::vector<size_t> unpublished_;  ///< last one first
  double pause_ = 0;
  std::string told_;
  double lonely_seconds_ = 0;
  bool told_lonely_ = false;
};

}  // namespace glint
