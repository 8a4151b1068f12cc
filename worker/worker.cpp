#include "worker/worker.h"

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <random>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "common/base/steady_clock.h"
#include "common/round/quarantine.h"
#include "common/round/round_files.h"
#include "worker/bake_runner.h"
#include "worker/execution_id.h"
#include "worker/home_line.h"
#include "worker/isolated_task.h"
#include "worker/lease_keeper.h"
#include "worker/line_chooser.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kLastDelivery = 3;        ///< a task that fails then is given up
constexpr double kReturnSeconds = 1;    ///< until a task that failed comes again, ...
constexpr double kIoReturnSeconds = 5;  ///< ... and where the disk is full or a server away
constexpr int kSignsPerLease = 3;
constexpr auto kIdle = std::chrono::milliseconds(250);

Clock::duration Seconds(double seconds) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

/// One bake at work: its runner, and its rounds' manifests as messages name them.
class BakeAtWork {
 public:
  static Result<std::unique_ptr<BakeAtWork>> Open(const QueuedBake& bake, const WorkerOptions& options,
                                                  WorkerMeter* meter) {
    const fs::path folder = options.store / bake.bake.Hex();
    auto home = std::make_unique<HomeLine>(folder, bake.shards, std::random_device{}());
    GLINT_ASSIGN_OR_RETURN(BakeRunner runner, BakeRunner::Open(folder, options.threads, options.memory_bytes,
                                                               meter, home->line()));
    GLINT_ASSIGN_OR_RETURN(ChunkStore store, ChunkStore::Open(folder));
    return std::unique_ptr<BakeAtWork>(
        new BakeAtWork(bake, folder, std::move(home), std::move(runner), std::move(store)));
  }

  const QueuedBake& bake() const { return bake_; }
  const fs::path& folder() const { return folder_; }
  BakeRunner& runner() { return runner_; }
  const ChunkStore& store() const { return store_; }
  LineChooser& lines() { return lines_; }
  /// Null: there is no such round (any more).
  std::shared_ptr<const RoundManifest> Round(const Digest& name) {
    const std::lock_guard lock(mutex_);
    if (round_ && round_name_ == name) return round_;
    Result<RoundManifest> read = ReadManifest(folder_, name);
    if (!read.ok() || read->Bake() != bake_.bake) return nullptr;
    round_ = std::make_shared<const RoundManifest>(std::move(read).value());
    round_name_ = name;
    return round_;
  }

 private:
  BakeAtWork(QueuedBake bake, fs::path folder, std::unique_ptr<HomeLine> home, BakeRunner runner,
             ChunkStore store)
      : bake_(std::move(bake)),
        folder_(std::move(folder)),
        home_(std::move(home)),
        runner_(std::move(runner)),
        store_(std::move(store)),
        lines_(bake_.shards, home_->line(), std::random_device{}()) {}

  const QueuedBake bake_;
  const fs::path folder_;
  const std::unique_ptr<HomeLine> home_;
  BakeRunner runner_;
  const ChunkStore store_;
  LineChooser lines_;
  std::mutex mutex_;
  Digest round_name_;
  std::shared_ptr<const RoundManifest> round_;
};

/// What became of a task.
struct Outcome {
  Status status;
  bool was_there = false;
  std::string error_output;
};

class Worker {
 public:
  Worker(TaskSource* source, const WorkerOptions& options, WorkerMeter* meter)
      : source_(*source),
        options_(options),
        meter_(*meter),
        execution_(ExecutionId()),
        keeper_(options.on_stuck) {}

  WorkerCounts Run() {
    while (!StopRequested()) {
      const std::optional<QueuedBake> bake = Choose();
      if (!bake || !Enter(*bake)) {
        std::this_thread::sleep_for(kIdle);
        continue;
      }
      Serve();
    }
    return {meter_.computed, meter_.found, meter_.returned, meter_.given_up};
  }

 private:
  // ---- Which bake ----

  std::optional<QueuedBake> Choose() {
    const std::vector<QueuedBake> bakes = ListFitting();
    if (bakes.empty()) return std::nullopt;
    return bakes[ChooseBake(bakes, &random_)];
  }

  /// Bakes with tasks that this worker can compute; says once why it takes none of another's.
  std::vector<QueuedBake> ListFitting() {
    Result<std::vector<QueuedBake>> listed = source_.List();
    Tell(listed.status());
    std::vector<QueuedBake> bakes;
    if (!listed.ok()) return bakes;
    for (QueuedBake& bake : *listed) {
      std::error_code error;
      if (bake.execution != execution_) {
        TellOnce(bake.bake, "its results are those of '" + bake.execution +
                                "', this worker's are those of '" + execution_ + "'");
      } else if (!fs::is_directory(options_.store / bake.bake.Hex(), error)) {
        TellOnce(bake.bake,
                 options_.store.string() + " has no folder of it: is that the coordinator's store?");
      } else {
        bakes.push_back(std::move(bake));
      }
    }
    return bakes;
  }

  /// Makes the bake the one at work.
  bool Enter(const QueuedBake& bake) {
    if (at_work_ && at_work_->bake().bake == bake.bake && at_work_->bake().shards == bake.shards) return true;
    at_work_.reset();  // first: memory for one bake
    Result<std::unique_ptr<BakeAtWork>> opened = BakeAtWork::Open(bake, options_, &meter_);
    if (!opened.ok()) {
      Log(LogLevel::kWarning, opened.status().message());
      return false;
    }
    at_work_ = std::move(opened).value();
    Log(LogLevel::kNote, "at work on bake " + bake.bake.Hex(), {{"bake_key", bake.bake.Hex()}});
    return true;
  }

  // ---- Its tasks ----

  void Serve() {
    leave_ = false;
    next_list_ = Clock::now() + Seconds(options_.share_seconds);
    std::vector<std::thread> slots;
    for (int i = 1; i < options_.threads; ++i) slots.emplace_back([this] { TakeTasks(); });
    TakeTasks();
    for (std::thread& slot : slots) slot.join();
  }

  /// One thread's tasks, until there are none for any thread, or other bakes have waited long enough.
  void TakeTasks() {
    Result<std::unique_ptr<TaskSubscription>> subscription = source_.Subscribe(at_work_->bake().bake);
    while (subscription.ok() && !StopRequested() && !leave_) {
      const LineChooser::Choice where = ChooseLine();
      Result<std::unique_ptr<TaskLease>> lease =
          (*subscription)->Fetch(where.line, where.waits ? kProbeSeconds : kFetchSeconds);
      if (lease.ok() && *lease) {
        ++meter_.busy;
        Handle(lease->get());
        --meter_.busy;
        MakeRoomForOthers();
      } else if (lease.ok() && where.waits) {
        at_work_->lines().FoundEmpty(where.line);
      } else if (meter_.busy == 0) {
        leave_ = true;  // all threads together: one alone would be missed until the others leave
      } else if (!lease.ok()) {
        std::this_thread::sleep_for(kIdle);
      }
    }
  }

  /// The line to ask next; asks the queue what there is if that is not known, though not all the time.
  LineChooser::Choice ChooseLine() {
    LineChooser& lines = at_work_->lines();
    if (const LineChooser::Choice choice = lines.Choose(SteadySeconds()); choice.waits) return choice;
    const std::lock_guard lock(list_mutex_);
    if (const LineChooser::Choice choice = lines.Choose(SteadySeconds()); choice.waits) return choice;
    std::this_thread::sleep_until(next_look_);
    std::vector<uint64_t> messages;
    for (const QueuedBake& bake : ListFitting())
      if (bake.bake == at_work_->bake().bake) messages = bake.messages;
    lines.Update(messages, SteadySeconds());
    next_look_ = Clock::now() + Seconds(kListSeconds);
    return lines.Choose(SteadySeconds());
  }

  void MakeRoomForOthers() {
    const std::unique_lock lock(list_mutex_, std::try_to_lock);
    if (!lock.owns_lock() || Clock::now() < next_list_) return;
    for (const QueuedBake& bake : ListFitting()) leave_ = leave_ || bake.bake != at_work_->bake().bake;
    next_list_ = Clock::now() + Seconds(options_.share_seconds);
  }

  void Handle(TaskLease* lease) {
    if (lease->deliveries() > 1) ++meter_.redelivered;
    const std::shared_ptr<const RoundManifest> round = at_work_->Round(lease->message().manifest);
    if (!round || lease->message().index >= round->blocks.size()) {
      lease->GiveUp();  // of a round that is over
      return;
    }
    const Stopwatch watch;
    at_work_->lines().Took(lease->message(), round->layer);
    Settle(lease, *round, Compute(lease, *round));
    at_work_->lines().Finished(watch.Seconds());
  }

  Outcome Compute(TaskLease* lease, const RoundManifest& round) {
    const size_t index = lease->message().index;
    if (at_work_->store().FindResult(round.Task(index).key)) return {{}, true, {}};
    const bool again = lease->deliveries() > 1;
    // A process of its own has its own deadline.
    const double deadline = again ? 2 * options_.deadline_seconds : options_.deadline_seconds;
    const LeaseKeeper::Guard kept =
        keeper_.Keep(lease, "task " + std::to_string(index) + " of bake " + at_work_->bake().bake.Hex(),
                     at_work_->bake().lease_seconds / kSignsPerLease, deadline);
    return again ? ComputeApart(lease->message()) : ComputeHere(round, index);
  }

  Outcome ComputeHere(const RoundManifest& round, size_t index) {
    try {
      const Result<bool> was_there = at_work_->runner().Run(round, index);
      return {was_there.status(), was_there.ok() && *was_there, {}};
    } catch (const std::bad_alloc&) {
      return {LimitExceeded("out of memory; give the worker fewer threads or a larger machine"), false, {}};
    }
  }

  Outcome ComputeApart(const TaskMessage& task) {
    CommandEnd end = RunCommand(Command(task), options_.deadline_seconds);
    return {std::move(end.status), false, std::move(end.error_output)};
  }

  std::vector<std::string> Command(const TaskMessage& task) const {
    const fs::path& folder = at_work_->folder();
    return RunTaskCommand(options_.program, folder, ManifestPath(folder, task.manifest), task.index);
  }

  void Settle(TaskLease* lease, const RoundManifest& round, const Outcome& outcome) {
    if (outcome.status.ok()) {
      ++(outcome.was_there ? meter_.found : meter_.computed);
      lease->Done();
      return;
    }
    const bool environment = outcome.status.kind() == ErrorKind::kIo;
    const std::string task = std::to_string(lease->message().index), bake = at_work_->bake().bake.Hex();
    Log(LogLevel::kWarning,
        "task " + task + " of bake " + bake + ": " + outcome.status.message() +
            (outcome.error_output.empty() ? "" : "; " + outcome.error_output),
        {{"bake_key", bake}, {"task", task}, {"deliveries", std::to_string(lease->deliveries())}});
    if (!environment && lease->deliveries() >= kLastDelivery && GiveUp(lease, round, outcome)) return;
    ++meter_.returned;
    lease->Return(environment ? kIoReturnSeconds : kReturnSeconds);
  }

  bool GiveUp(TaskLease* lease, const RoundManifest& round, const Outcome& outcome) {
    const TaskMessage& task = lease->message();
    const Status written =
        WriteQuarantine(at_work_->folder(), round.Task(task.index).key,
                        {task.index, round.layer, lease->deliveries(), outcome.status.message(),
                         outcome.error_output, ShellLine(Command(task))});
    if (!written.ok()) {
      Log(LogLevel::kWarning, written.message());
      return false;
    }
    ++meter_.given_up;
    lease->GiveUp();
    return true;
  }

  // ---- Messages ----

  void TellOnce(const Digest& bake, const std::string& why) {
    if (told_.insert(bake).second)
      Log(LogLevel::kNote, "takes no task of bake " + bake.Hex() + ": " + why, {{"bake_key", bake.Hex()}});
  }
  void Tell(const Status& queue_status) {
    if (!queue_status.ok() && queue_status.message() != told_status_)
      Log(LogLevel::kWarning, queue_status.message() + "; trying again until it answers");
    told_status_ = queue_status.message();
  }

  TaskSource& source_;
  const WorkerOptions options_;
  WorkerMeter& meter_;
  const std::string execution_;
  std::mt19937 random_{std::random_device{}()};
  LeaseKeeper keeper_;
  std::unique_ptr<BakeAtWork> at_work_;
  std::atomic<bool> leave_{false};
  std::mutex list_mutex_;  ///< of what follows, while threads take tasks
  Clock::time_point next_list_, next_look_;
  std::set<Digest> told_;
  std::string told_status_;
};

}  // namespace

WorkerCounts RunWorker(TaskSource* source, const WorkerOptions& options, WorkerMeter* meter) {
  WorkerMeter own;
  return Worker(source, options, meter ? meter : &own).Run();
}

}  // namespace glint
