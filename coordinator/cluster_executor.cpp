#include "coordinator/cluster_executor.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "common/round/quarantine.h"
#include "common/round/round_files.h"
#include "coordinator/publish_round.h"
#include "worker/execution_id.h"

namespace glint {
namespace {

constexpr double kShortestPause = 0.02, kLongestPause = 2;  ///< seconds between looks at the folder
constexpr double kLookShare = 0.05;                         ///< of the time, spent on looking
constexpr double kLonely = 10;  ///< seconds without any worker before the user is told

/// Which of a round's tasks have no result yet.
class OpenTasks {
 public:
  OpenTasks(const ChunkStore& store, const Round& round, const std::function<void(size_t, bool)>& on_done)
      : store_(store), round_(round), on_done_(on_done), missing_(round.tasks.size()) {
    for (size_t i = 0; i < missing_.size(); ++i) missing_[i] = i;
    Collect(true);
  }
  /// Looks at the folder.
  void Collect(bool was_there = false) {
    const auto begin = std::chrono::steady_clock::now();
    std::erase_if(missing_, [&](size_t i) {
      if (!store_.FindResult(round_.tasks[i].key)) return false;
      on_done_(i, was_there);
      return true;
    });
    look_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  const std::vector<size_t>& missing() const { return missing_; }
  /// Seconds until the next look: looking at many tasks on a network file system is not free.
  double Pause() const { return std::clamp(look_seconds_ / kLookShare, kShortestPause, kLongestPause); }

 private:
  const ChunkStore& store_;
  const Round& round_;
  const std::function<void(size_t, bool)>& on_done_;
  std::vector<size_t> missing_;
  double look_seconds_ = 0;
};

class ClusterExecutor : public Executor {
 public:
  ClusterExecutor(const ExecutorInput& input, TaskPublisher* queue, const ClusterOptions& options)
      : input_(input), queue_(*queue), options_(options) {
    bake_.bake = BakeKey(ExecutionId(), input.scene, input.settings);
    bake_.execution = ExecutionId();
    bake_.priority = options.priority;
    bake_.lease_seconds = options.lease_seconds;
  }
  ~ClusterExecutor() override {
    if (const Status closed = queue_.Close(bake_.bake); !closed.ok() && begun_)
      Log(LogLevel::kWarning, closed.message() + "; workers drop its tasks as they come to them");
  }

  Status Run(const Round& round, const std::function<void(size_t, bool)>& on_done) override {
    OpenTasks open(input_.store, round, on_done);
    if (open.missing().empty()) return {};
    begun_ = true;
    // Whoever runs a bake again wants every task tried again.
    for (const size_t i : open.missing()) ForgetQuarantine(input_.store.root(), round.tasks[i].key);
    GLINT_ASSIGN_OR_RETURN(manifest_, PublishRound(input_, round));
    unpublished_.clear();
    for (;;) {
      if (input_.stop()) return Interrupted("stopped on request");
      // In this order: what was acknowledged before the queue answered has its result.
      const Result<std::optional<QueueState>> state = queue_.State(bake_.bake);
      open.Collect();
      if (open.missing().empty()) return {};
      Status fed = state.ok() ? Feed(*state, round, open.missing()) : state.status();
      if (!fed.ok() && fed.kind() != ErrorKind::kIo) return fed;
      Tell(fed);
      Watch(state, open.Pause());
      options_.wait(open.Pause());
    }
  }

 private:
  /// Puts tasks into the queue that it does not have. kIo: it does not answer.
  Status Feed(const std::optional<QueueState>& state, const Round& round,
              const std::vector<size_t>& missing) {
    if (!state) {
      unpublished_.clear();
      GLINT_RETURN_IF_ERROR(queue_.Open(bake_));
    }
    const uint64_t queued = state ? state->waiting + state->in_flight : 0;
    if (queued == 0 && unpublished_.empty()) {  // at first, and whenever the queue has lost some
      GLINT_ASSIGN_OR_RETURN(unpublished_, NotGivenUp(round, missing));
      std::reverse(unpublished_.begin(), unpublished_.end());
    }
    const uint64_t room = options_.max_queued - std::min(options_.max_queued, queued);
    if (room < options_.max_queued / 2) return {};
    std::vector<TaskMessage> messages;
    while (messages.size() < room && !unpublished_.empty()) {
      messages.push_back({manifest_, unpublished_.back()});
      unpublished_.pop_back();
    }
    return messages.empty() ? Status() : queue_.Publish(bake_.bake, messages);
  }

  /// kInternal: all of them were given up.
  Result<std::vector<size_t>> NotGivenUp(const Round& round, const std::vector<size_t>& missing) const {
    std::vector<size_t> rest;
    std::optional<QuarantineRecord> first;
    for (const size_t i : missing) {
      std::optional<QuarantineRecord> record = ReadQuarantine(input_.store.root(), round.tasks[i].key);
      if (!record) rest.push_back(i);
      if (record && !first) first = std::move(record);
    }
    if (!rest.empty()) return rest;
    return InternalError(std::to_string(missing.size()) + " of " + std::to_string(round.tasks.size()) +
                         " tasks of layer " + std::to_string(round.tasks.front().layer) +
                         " were given up, the others are done; task " + std::to_string(first->task) + ": " +
                         first->reason + "; to see it again: " + first->command +
                         "; to try them all again, resume the bake");
  }

  /// Says once that the queue does not answer, and once that it does again.
  void Tell(const Status& queue_status) {
    if (queue_status.message() != told_ && !queue_status.ok())
      Log(LogLevel::kWarning, queue_status.message() + "; trying again until it answers");
    if (queue_status.ok() && !told_.empty()) Log(LogLevel::kNote, "the queue answers again");
    told_ = queue_status.message();
  }

  /// Says once if nobody is there to work.
  void Watch(const Result<std::optional<QueueState>>& state, double pause) {
    const bool lonely =
        state.ok() && *state && (*state)->waiting > 0 && (*state)->in_flight == 0 && (*state)->requests == 0;
    lonely_seconds_ = lonely ? lonely_seconds_ + pause : 0;
    if (lonely_seconds_ < kLonely || told_lonely_) return;
    told_lonely_ = true;
    Log(LogLevel::kNote,
        "no worker asks for the tasks in " + input_.store.root().string() +
            "; start 'glint worker' where the bake's results can be made: " + bake_.execution);
  }

  const ExecutorInput input_;
  TaskPublisher& queue_;
  const ClusterOptions options_;
  QueuedBake bake_;
  bool begun_ = false;
  Digest manifest_;
  std::vector<size_t> unpublished_;  ///< last one first
  std::string told_;
  double lonely_seconds_ = 0;
  bool told_lonely_ = false;
};

}  // namespace

void SleepSeconds(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

ExecutorFactory MakeClusterExecutor(TaskPublisher* queue, const ClusterOptions& options) {
  return [=](const ExecutorInput& input) -> Result<std::unique_ptr<Executor>> {
    return std::unique_ptr<Executor>(std::make_unique<ClusterExecutor>(input, queue, options));
  };
}

}  // namespace glint
