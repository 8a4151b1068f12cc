#include "tests/cluster/simulated_cluster.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <queue>
#include <random>
#include <utility>

#include "common/base/hash.h"
#include "coordinator/partition.h"
#include "coordinator/round_dispatcher.h"
#include "worker/line_chooser.h"

namespace glint {
namespace {

/// Simulated time: things happen in order, and at one moment in the order in which they were planned.
class Clock {
 public:
  double now() const { return now_; }
  void After(double seconds, std::function<void()> what) {
    events_.push({now_ + seconds, next_++, std::move(what)});
  }
  void Run(double until) {
    while (!events_.empty() && events_.top().when <= until) {
      const Event event = events_.top();
      events_.pop();
      now_ = event.when;
      event.what();
    }
    now_ = std::max(now_, until);
  }

 private:
  struct Event {
    double when;
    uint64_t order;
    std::function<void()> what;
    bool operator<(const Event& o) const { return std::pair(when, order) > std::pair(o.when, o.order); }
  };
  std::priority_queue<Event> events_;
  double now_ = 0;
  uint64_t next_ = 0;
};

/// The queue: lines of messages, leases that run out, workers that wait.
class Queue : public TaskPublisher {
 public:
  struct Message {
    uint64_t id;
    TaskMessage task;
  };
  using Waiter = std::function<void(std::optional<Message>)>;

  Queue(Clock* clock, const SimulatedFleet& fleet)
      : clock_(*clock), lease_seconds_(fleet.lease_seconds), look_seconds_(fleet.look_seconds) {}

  Status Open(const QueuedBake& bake) override {
    bakes_[bake.bake] = {bake, std::vector<Line>(bake.shards), {}};
    return {};
  }
  Status Publish(const Digest& bake, std::span<const TaskMessage> messages) override {
    for (const TaskMessage& task : messages) Put(bake, {next_++, task});
    return {};
  }
  Result<std::optional<QueueState>> State(const Digest& bake) override {
    const auto found = bakes_.find(bake);
    if (found == bakes_.end()) return std::optional<QueueState>();
    QueueState state{0, found->second.in_flight.size(), 1};
    for (const Line& line : found->second.lines) state.waiting += line.messages.size();
    return std::optional(state);
  }
  Status Close(const Digest& bake) override {
    bakes_.erase(bake);
    return {};
  }

  /// Tells what waits, once the server has come to it: it answers one worker after the other.
  void Look(std::function<void(const std::vector<QueuedBake>&)> looker) {
    size_t lines = 0;
    for (const QueuedBake& bake : List())
      lines += static_cast<size_t>(
          std::count_if(bake.messages.begin(), bake.messages.end(), [](uint64_t n) { return n > 0; }));
    answered_ = std::max(answered_, clock_.now()) + look_seconds_ * static_cast<double>(lines);
    clock_.After(answered_ - clock_.now(), [this, looker = std::move(looker)] { looker(List()); });
  }
  /// Bakes with messages.
  std::vector<QueuedBake> List() const {
    std::vector<QueuedBake> list;
    for (const auto& [key, bake] : bakes_) {
      list.push_back(bake.about);
      uint64_t messages = bake.in_flight.size();
      for (const Line& line : bake.lines) {
        list.back().messages.push_back(line.messages.size());
        messages += line.messages.size();
      }
      for (const auto& [id, message] : bake.in_flight) ++list.back().messages[message.task.shard];
      if (messages == 0) list.pop_back();
    }
    return list;
  }
  /// Gives the waiter a message now, or when one comes, or nothing after `seconds`.
  void Fetch(const Digest& bake, uint32_t shard, double seconds, Waiter waiter) {
    const auto found = bakes_.find(bake);
    if (found == bakes_.end() || shard >= found->second.lines.size()) {
      clock_.After(seconds, [waiter] { waiter(std::nullopt); });
      return;
    }
    auto once = std::make_shared<Waiter>(std::move(waiter));
    found->second.lines[shard].waiters.push_back(once);
    Serve(bake, shard);
    clock_.After(seconds, [once] {
      if (*once) std::exchange(*once, nullptr)(std::nullopt);
    });
  }
  /// A message's worker gave its last sign of life.
  void LoseWorker(const Digest& bake, const Message& message) {
    clock_.After(lease_seconds_, [=, this] {
      const auto found = bakes_.find(bake);
      if (found != bakes_.end() && found->second.in_flight.erase(message.id) > 0) Put(bake, message);
    });
  }
  void Done(const Digest& bake, const Message& message) {
    const auto found = bakes_.find(bake);
    if (found != bakes_.end()) found->second.in_flight.erase(message.id);
  }

 private:
  struct Line {
    std::deque<Message> messages;
    std::deque<std::shared_ptr<Waiter>> waiters;  ///< those that were answered are empty
  };
  struct Bake {
    QueuedBake about;
    std::vector<Line> lines;
    std::map<uint64_t, Message> in_flight;
  };

  void Put(const Digest& bake, const Message& message) {
    bakes_.at(bake).lines.at(message.task.shard).messages.push_back(message);
    Serve(bake, message.task.shard);
  }
  void Serve(const Digest& key, uint32_t shard) {
    Bake& bake = bakes_.at(key);
    Line& line = bake.lines[shard];
    while (!line.messages.empty() && !line.waiters.empty()) {
      const std::shared_ptr<Waiter> waiter = line.waiters.front();
      line.waiters.pop_front();
      if (!*waiter) continue;
      const Message message = line.messages.front();
      line.messages.pop_front();
      bake.in_flight.emplace(message.id, message);
      clock_.After(0, [message, answer = std::exchange(*waiter, nullptr)] { answer(message); });
    }
  }

  Clock& clock_;
  const double lease_seconds_, look_seconds_;
  double answered_ = 0;  ///< when the server is done with those who have asked it
  uint64_t next_ = 0;
  std::map<Digest, Bake> bakes_;
};

/// A bake: its surface, its rounds one after the other, and what of them is finished.
class Bake : public RoundLedger {
 public:
  Bake(const SimulatedWork& work, uint32_t number, Clock* clock, Queue* queue, double lease_seconds)
      : work_(work), clock_(*clock) {
    QueuedBake about;
    about.bake = Hasher().String("bake").Add(number).Finish();
    about.execution = "simulated";
    about.priority = work.priority;
    about.lease_seconds = lease_seconds;
    key_ = about.bake;
    ClusterOptions options;
    options.now = [this, clock] { return clock->now() + looked_seconds_; };
    dispatcher_ = std::make_unique<RoundDispatcher>(queue, about, options, [] { return false; });
    for (uint32_t v = 0; v < work.vertices; ++v) shape_.push_back(Unevenness(v));
    traced_.assign(work.vertices, false);
    BeginLayer();
  }

  bool Finished(size_t task) override {
    looked_seconds_ += kFindSeconds;
    return finished_[task];
  }
  std::optional<QuarantineRecord> GivenUp(size_t) override { return std::nullopt; }

  const Digest& key() const { return key_; }
  const SimulatedWork& work() const { return work_; }
  int layer() const { return layer_; }
  const GatherBlock& block(const TaskMessage& task) const { return tasks_[task.index].block; }
  bool Wants(const TaskMessage& task) const { return task.manifest == manifest_ && !finished_[task.index]; }
  /// Cost of a vertex, relative to the mean.
  float shape(uint32_t vertex) const { return shape_[vertex]; }

  /// A worker has traced a vertex, in so many seconds.
  void Trace(uint32_t vertex, double seconds) {
    ++vertices_traced_;
    traced_again_ += traced_[vertex];
    if (traced_[vertex]) result.again_seconds += seconds;
    traced_[vertex] = true;
  }
  void Finish(const TaskMessage& task, double seconds, uint32_t home) {
    if (!Wants(task)) {
      ++result.computed_twice;
      return;
    }
    finished_[task.index] = true;
    measured_.push_back({block(task), seconds, home});
  }
  SimulatedBake Report() {
    double surface = 0;
    for (const float s : shape_) surface += s;
    result.work_seconds = surface * (work_.trace_seconds + work_.layers * work_.gather_seconds);
    result.traced_again =
        vertices_traced_ > 0 ? static_cast<double>(traced_again_) / static_cast<double>(vertices_traced_) : 0;
    if (layer_ < work_.layers) result.seconds = clock_.now();
    return result;
  }

  SimulatedBake result;

 private:
  static constexpr double kFindSeconds = 20e-6;  ///< to look whether a task is finished

  /// Slow waves of cheap and dear regions, with the mean 1.
  float Unevenness(uint32_t v) const {
    const double phase = 2 * 3.14159265358979 * 5 * v / work_.vertices;
    const double swing = (work_.unevenness - 1) / (work_.unevenness + 1);
    return static_cast<float>(1 + swing * std::sin(phase));
  }

  void BeginLayer() {
    // As PlanRound: by a guess that knows nothing of the regions, then by what was measured.
    std::vector<VertexWork> vertices(
        work_.vertices, {static_cast<float>(work_.trace_seconds + work_.gather_seconds), std::nullopt});
    if (!measured_.empty()) vertices = SpreadWork(measured_, work_.vertices);
    const std::vector<GatherBlock> blocks = CutByCost(vertices, 1, 1);
    measured_.clear();
    tasks_.clear();
    for (const GatherBlock& block : blocks)
      tasks_.push_back({{}, layer_, block, vertices[block.first_vertex].home});
    finished_.assign(blocks.size(), false);
    result.tasks += blocks.size();
    std::vector<size_t> open(blocks.size());
    for (size_t i = 0; i < open.size(); ++i) open[i] = i;
    manifest_ = Hasher().Add(key_).Add(layer_).Finish();
    begin_ = clock_.now();
    dispatcher_->Begin({manifest_, tasks_}, std::move(open), this, [](size_t, bool) {});
    Look();
  }

  void Look() {
    const Result<bool> finished = dispatcher_->Look();
    if (finished.ok() && *finished) {
      result.round_seconds += clock_.now() - begin_;
      clock_.After(work_.merge_seconds, [this] { EndLayer(); });
    } else {
      clock_.After(dispatcher_->Pause(), [this] { Look(); });
    }
  }

  void EndLayer() {
    if (++layer_ < work_.layers) {
      BeginLayer();
    } else {
      result.seconds = clock_.now();
      (void)dispatcher_->Close();
    }
  }

  const SimulatedWork work_;
  Clock& clock_;
  Digest key_, manifest_;
  std::unique_ptr<RoundDispatcher> dispatcher_;
  std::vector<float> shape_;
  std::vector<bool> traced_;
  uint64_t vertices_traced_ = 0, traced_again_ = 0;
  int layer_ = 0;
  double begin_ = 0, looked_seconds_ = 0;
  std::vector<TaskSpec> tasks_;
  std::vector<bool> finished_;
  std::vector<MeasuredBlock> measured_;
};

/// A worker of one thread: worker/worker.cpp's loop, in events.
class Worker {
 public:
  Worker(Clock* clock, Queue* queue, std::map<Digest, Bake*>* bakes, const SimulatedFleet& fleet,
         uint64_t number)
      : clock_(*clock),
        queue_(*queue),
        bakes_(*bakes),
        fleet_(fleet),
        number_(number),
        random_(static_cast<uint32_t>(fleet.seed + 7919 * number)) {
    slowness_ = static_cast<double>(number) < fleet.stragglers * fleet.workers ? fleet.straggling : 1;
    PlanDeath();
    clock_.After(0, [this] { Choose(); });
  }

 private:
  static constexpr double kIdleSeconds = 0.25, kShareSeconds = 30;

  void Choose() {
    queue_.Look([this](const std::vector<QueuedBake>& bakes) { Choose(bakes); });
  }
  void Choose(const std::vector<QueuedBake>& bakes) {
    if (bakes.empty()) return clock_.After(kIdleSeconds, [this] { Choose(); });
    const QueuedBake& bake = bakes[ChooseBake(bakes, &random_)];
    if (!at_work_ || at_work_->key() != bake.bake) Enter(bake);
    stay_until_ = clock_.now() + kShareSeconds;
    Fetch();
  }

  void Enter(const QueuedBake& bake) {
    at_work_ = bakes_.at(bake.bake);
    home_ = Home(bake.shards);
    lines_ = std::make_unique<LineChooser>(bake.shards, home_, random_());
    kept_.assign(at_work_->work().vertices, false);
    opened_ = false;
    layer_ = -1;
  }

  /// Another for each worker, as long as there are lines.
  uint32_t Home(uint32_t lines) const {
    constexpr uint64_t kOdd = 0x9e3779b1;
    return static_cast<uint32_t>(number_ * kOdd % lines);
  }

  void Fetch() {
    const LineChooser::Choice where = lines_->Choose(clock_.now());
    if (where.waits) return Fetch(where);
    if (clock_.now() < next_look_) return clock_.After(next_look_ - clock_.now(), [this] { Fetch(); });
    queue_.Look([this](const std::vector<QueuedBake>& bakes) {
      lines_->Update({}, clock_.now());
      for (const QueuedBake& bake : bakes)
        if (bake.bake == at_work_->key()) lines_->Update(bake.messages, clock_.now());
      next_look_ = clock_.now() + kListSeconds;
      Fetch(lines_->Choose(clock_.now()));
    });
  }
  void Fetch(const LineChooser::Choice& where) {
    queue_.Fetch(at_work_->key(), where.line, where.waits ? kProbeSeconds : kFetchSeconds,
                 [this, where](std::optional<Queue::Message> message) {
                   if (message) return Compute(*message);
                   if (!where.waits) return Choose();
                   lines_->FoundEmpty(where.line);
                   Fetch();
                 });
  }

  void Compute(const Queue::Message& message) {
    lines_->Took(message.task, at_work_->layer());
    const bool wanted = at_work_->Wants(message.task);
    const double gather = wanted ? slowness_ * GatherSeconds(at_work_->block(message.task)) : 0;
    const double turn = wanted ? slowness_ * TurnSeconds() : 0;
    const double seconds = fleet_.task_seconds + gather + turn;
    if (clock_.now() + seconds > death_) return Die(message);
    at_work_->result.worker_seconds += seconds;
    at_work_->result.turn_seconds += turn;
    at_work_->result.message_seconds += fleet_.task_seconds;
    clock_.After(seconds, [this, message, gather, wanted, seconds] {
      lines_->Finished(seconds);
      if (wanted) at_work_->Finish(message.task, gather, home_);
      queue_.Done(at_work_->key(), message);
      if (clock_.now() < stay_until_) return Fetch();
      bool others = false;
      for (const QueuedBake& bake : queue_.List()) others = others || bake.bake != at_work_->key();
      stay_until_ = clock_.now() + kShareSeconds;
      others ? Choose() : Fetch();
    });
  }

  double GatherSeconds(const GatherBlock& block) {
    double seconds = 0;
    for (uint32_t v = block.first_vertex; v < block.first_vertex + block.vertices; ++v) {
      seconds += at_work_->shape(v) * at_work_->work().gather_seconds;
      if (kept_[v]) continue;
      kept_[v] = true;
      const double trace = at_work_->shape(v) * at_work_->work().trace_seconds;
      at_work_->Trace(v, slowness_ * trace);
      seconds += trace;
    }
    return seconds;
  }
  double TurnSeconds() {
    double seconds = std::exchange(opened_, true) ? 0 : at_work_->work().open_seconds;
    if (std::exchange(layer_, at_work_->layer()) != at_work_->layer())
      seconds += at_work_->work().turn_seconds;
    return seconds;
  }

  void PlanDeath() {
    if (fleet_.seconds_between_deaths <= 0) return;
    death_ = clock_.now() + std::exponential_distribution<double>(1 / fleet_.seconds_between_deaths)(random_);
  }
  /// Somewhere in the middle of a task.
  void Die(const Queue::Message& message) {
    ++at_work_->result.deaths;
    const double rest = std::max(death_ - clock_.now(), 0.0);
    clock_.After(rest, [this, message] {
      queue_.LoseWorker(at_work_->key(), message);
      at_work_ = nullptr;
      clock_.After(fleet_.restart_seconds, [this] {
        PlanDeath();
        Choose();
      });
    });
  }

  Clock& clock_;
  Queue& queue_;
  std::map<Digest, Bake*>& bakes_;
  const SimulatedFleet fleet_;
  const uint64_t number_;
  std::mt19937 random_;
  double slowness_ = 1, death_ = 1e300, next_look_ = 0, stay_until_ = 0;
  Bake* at_work_ = nullptr;
  std::unique_ptr<LineChooser> lines_;
  std::vector<bool> kept_;
  bool opened_ = false;
  int layer_ = -1;
  uint32_t home_ = 0;
};

}  // namespace

std::vector<SimulatedBake> SimulateCluster(const std::vector<SimulatedWork>& work,
                                           const SimulatedFleet& fleet, double until) {
  Clock clock;
  Queue queue(&clock, fleet);
  std::vector<std::unique_ptr<Bake>> bakes;
  std::map<Digest, Bake*> by_key;
  for (const SimulatedWork& w : work) {
    bakes.push_back(
        std::make_unique<Bake>(w, static_cast<uint32_t>(bakes.size()), &clock, &queue, fleet.lease_seconds));
    by_key[bakes.back()->key()] = bakes.back().get();
  }
  std::vector<std::unique_ptr<Worker>> workers;
  for (int i = 0; i < fleet.workers; ++i)
    workers.push_back(std::make_unique<Worker>(&clock, &queue, &by_key, fleet, static_cast<uint64_t>(i)));
  const auto running = [&] {
    return std::any_of(bakes.begin(), bakes.end(),
                       [](const auto& b) { return b->layer() < b->work().layers; });
  };
  constexpr double kStep = 1;
  while (running() && clock.now() < until) clock.Run(std::min(clock.now() + kStep, until));
  std::vector<SimulatedBake> results;
  for (const auto& bake : bakes) results.push_back(bake->Report());
  return results;
}

}  // namespace glint
