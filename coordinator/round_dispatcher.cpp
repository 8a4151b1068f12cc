#include "coordinator/round_dispatcher.h"

#include <algorithm>
#include <utility>

#include "common/base/log.h"
#include "common/queue/shard.h"

namespace glint {
namespace {

constexpr double kShortestPause = 0.02, kLongestPause = 2;  ///< seconds between looks
constexpr double kLookShare = 0.05;                         ///< of the time, spent on looking
constexpr double kLonely = 10;  ///< seconds without any worker before the user is told

uint32_t Vertices(const QueuedRound& round) {
  const GatherBlock& last = round.tasks.back().block;
  return last.first_vertex + last.vertices;
}

/// The line that a task waits in: that of the worker which holds its hits, else its shard's.
uint32_t LineOfTask(const QueuedRound& round, size_t i, uint32_t lines) {
  const TaskSpec& task = round.tasks[i];
  return task.home && *task.home < lines ? *task.home
                                         : ShardOf(task.block.first_vertex, Vertices(round), lines);
}

/// Orders tasks so that the first ones are spread over all lines: not all may fit into the queue at once.
void SpreadOverLines(const QueuedRound& round, uint32_t lines, std::vector<size_t>* tasks) {
  std::vector<uint32_t> length(lines, 0);
  std::vector<std::pair<uint32_t, size_t>> placed;  // place in its line, task
  for (const size_t task : *tasks) placed.emplace_back(length[LineOfTask(round, task, lines)]++, task);
  std::sort(placed.begin(), placed.end());
  std::transform(placed.begin(), placed.end(), tasks->begin(), [](const auto& p) { return p.second; });
}

}  // namespace

Status RoundDispatcher::Run(const QueuedRound& round, std::vector<size_t> open, RoundLedger* ledger,
                            OnDone on_done) {
  Begin(round, std::move(open), ledger, std::move(on_done));
  for (;;) {
    if (stop_()) return Interrupted("stopped on request");
    GLINT_ASSIGN_OR_RETURN(const bool finished, Look());
    if (finished) return {};
    options_.wait(pause_);
  }
}

void RoundDispatcher::Begin(const QueuedRound& round, std::vector<size_t> open, RoundLedger* ledger,
                            OnDone on_done) {
  bake_.shards = ShardsFor(Vertices(round));
  round_ = round;
  open_ = std::move(open);
  ledger_ = ledger;
  on_done_ = std::move(on_done);
  unpublished_.clear();
}

Result<bool> RoundDispatcher::Look() {
  const double begin = options_.now();
  // In this order: what was acknowledged before the queue answered has its result.
  const Result<std::optional<QueueState>> state = queue_.State(bake_.bake);
  Collect();
  // Looking at many tasks on a network file system is not free.
  pause_ = std::clamp((options_.now() - begin) / kLookShare, kShortestPause, kLongestPause);
  if (open_.empty()) return true;
  const Status fed = state.ok() ? Feed(*state) : state.status();
  if (!fed.ok() && fed.kind() != ErrorKind::kIo) return fed;
  Tell(fed);
  Watch(state);
  return false;
}

void RoundDispatcher::Collect() {
  std::erase_if(open_, [&](size_t i) {
    const bool finished = ledger_->Finished(i);
    if (finished) on_done_(i, false);
    return finished;
  });
}

/// Puts tasks into the queue that it does not have. kIo: it does not answer.
Status RoundDispatcher::Feed(const std::optional<QueueState>& state) {
  if (!state) {
    unpublished_.clear();
    GLINT_RETURN_IF_ERROR(queue_.Open(bake_));
  }
  const uint64_t queued = state ? state->waiting + state->in_flight : 0;
  if (queued == 0 && unpublished_.empty()) {  // at first, and whenever the queue has lost some
    GLINT_ASSIGN_OR_RETURN(unpublished_, NotGivenUp());
    SpreadOverLines(round_, bake_.shards, &unpublished_);
    std::reverse(unpublished_.begin(), unpublished_.end());
  }
  const uint64_t room = options_.max_queued - std::min(options_.max_queued, queued);
  return room < options_.max_queued / 2 ? Status() : Publish(room);
}

/// kInternal: all open tasks were given up.
Result<std::vector<size_t>> RoundDispatcher::NotGivenUp() const {
  std::vector<size_t> rest;
  std::optional<QuarantineRecord> first;
  for (const size_t i : open_) {
    std::optional<QuarantineRecord> record = ledger_->GivenUp(i);
    if (!record) rest.push_back(i);
    if (record && !first) first = std::move(record);
  }
  if (!rest.empty()) return rest;
  return InternalError(std::to_string(open_.size()) + " of " + std::to_string(round_.tasks.size()) +
                       " tasks of layer " + std::to_string(round_.tasks.front().layer) +
                       " were given up, the others are done; task " + std::to_string(first->task) + ": " +
                       first->reason + "; to see it again: " + first->command +
                       "; to try them all again, resume the bake");
}

Status RoundDispatcher::Publish(uint64_t room) {
  std::vector<TaskMessage> messages;
  while (messages.size() < room && !unpublished_.empty()) {
    const size_t task = unpublished_.back();
    messages.push_back({round_.manifest, task, LineOfTask(round_, task, bake_.shards)});
    unpublished_.pop_back();
  }
  return messages.empty() ? Status() : queue_.Publish(bake_.bake, messages);
}

/// Says once that the queue does not answer, and once that it does again.
void RoundDispatcher::Tell(const Status& queue_status) {
  if (queue_status.message() != told_ && !queue_status.ok())
    Log(LogLevel::kWarning, queue_status.message() + "; trying again until it answers");
  if (queue_status.ok() && !told_.empty()) Log(LogLevel::kNote, "the queue answers again");
  told_ = queue_status.message();
}

/// Says once if nobody is there to work.
void RoundDispatcher::Watch(const Result<std::optional<QueueState>>& state) {
  const bool lonely =
      state.ok() && *state && (*state)->waiting > 0 && (*state)->in_flight == 0 && (*state)->requests == 0;
  lonely_seconds_ = lonely ? lonely_seconds_ + pause_ : 0;
  if (lonely_seconds_ < kLonely || told_lonely_) return;
  told_lonely_ = true;
  Log(LogLevel::kNote, "no worker asks for the tasks of bake " + bake_.bake.Hex() +
                           "; start 'glint worker' where its results can be made: " + bake_.execution);
}

}  // namespace glint
