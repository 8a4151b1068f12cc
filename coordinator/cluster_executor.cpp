#include "coordinator/cluster_executor.h"

#include <chrono>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "common/round/quarantine.h"
#include "coordinator/publish_round.h"
#include "coordinator/round_dispatcher.h"
#include "worker/execution_id.h"

namespace glint {
namespace {

QueuedBake Describe(const ExecutorInput& input, const ClusterOptions& options) {
  QueuedBake bake;
  bake.bake = BakeKey(ExecutionId(), input.scene, input.settings);
  bake.execution = ExecutionId();
  bake.priority = options.priority;
  bake.lease_seconds = options.lease_seconds;
  return bake;
}

/// A round's tasks in the bake's folder.
class FolderLedger : public RoundLedger {
 public:
  FolderLedger(const ChunkStore& store, const Round& round) : store_(store), round_(round) {}
  bool Finished(size_t task) override { return store_.FindResult(round_.tasks[task].key).has_value(); }
  std::optional<QuarantineRecord> GivenUp(size_t task) override {
    return ReadQuarantine(store_.root(), round_.tasks[task].key);
  }

 private:
  const ChunkStore& store_;
  const Round& round_;
};

class ClusterExecutor : public Executor {
 public:
  ClusterExecutor(const ExecutorInput& input, TaskPublisher* queue, const ClusterOptions& options)
      : input_(input), dispatcher_(queue, Describe(input, options), options, input.stop) {}
  ~ClusterExecutor() override {
    if (const Status closed = dispatcher_.Close(); !closed.ok() && begun_)
      Log(LogLevel::kWarning, closed.message() + "; workers drop its tasks as they come to them");
  }

  Status Run(const Round& round, const std::function<void(size_t, bool)>& on_done) override {
    const std::vector<size_t> missing = FindMissing(input_.store, round);
    for (size_t i = 0, next = 0; i < round.tasks.size(); ++i) {
      const bool open = next < missing.size() && missing[next] == i;
      next += open;
      if (!open) on_done(i, true);
    }
    if (missing.empty()) return {};
    begun_ = true;
    // Whoever runs a bake again wants every task tried again.
    for (const size_t i : missing) ForgetQuarantine(input_.store.root(), round.tasks[i].key);
    GLINT_ASSIGN_OR_RETURN(const Digest manifest, PublishRound(input_, round));
    FolderLedger ledger(input_.store, round);
    return dispatcher_.Run({manifest, round.tasks}, missing, &ledger, on_done);
  }

 private:
  const ExecutorInput input_;
  RoundDispatcher dispatcher_;
  bool begun_ = false;
};

}  // namespace

void SleepSeconds(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

ExecutorFactory MakeClusterExecutor(TaskPublisher* queue, const ClusterOptions& options) {
  return [=](const ExecutorInput& input) -> Result<std::unique_ptr<Executor>> {
    return std::unique_ptr<Executor>(std::make_unique<ClusterExecutor>(input, queue, options));
  };
}

}  // namespace glint
