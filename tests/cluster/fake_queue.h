#pragma once

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "common/queue/task_queue.h"

namespace glint {

/// A queue in memory, with the faults of real ones at a test's call. Leases do not expire by themselves.
class FakeQueue : public TaskPublisher, public TaskSource {
 public:
  struct Message {
    TaskMessage task;
    int deliveries = 0;
  };

  // ---- Faults ----

  void Lose() {
    const std::lock_guard lock(mutex_);
    bakes_.clear();
  }
  void SetDown(bool down) {
    const std::lock_guard lock(mutex_);
    down_ = down;
  }
  /// As if the coordinator had been killed before it could close anything.
  void IgnoreClosing() { ignores_closing_ = true; }

  // ---- What happened ----

  size_t published = 0, opened = 0, most_queued = 0, done = 0, returned = 0, given_up = 0;
  size_t bakes() const { return bakes_.size(); }

  // ---- Coordinator's side ----

  Status Open(const QueuedBake& bake) override {
    const std::lock_guard lock(mutex_);
    if (down_) return Down();
    ++opened;
    bakes_[bake.bake] = {bake, std::vector<std::deque<Message>>(bake.shards), 0};
    return {};
  }
  Status Publish(const Digest& bake, std::span<const TaskMessage> messages) override {
    const std::lock_guard lock(mutex_);
    if (down_) return Down();
    Bake& known = bakes_.at(bake);
    for (const TaskMessage& task : messages) known.lines.at(task.shard).push_back({task, 0});
    published += messages.size();
    most_queued = std::max<size_t>(most_queued, known.Waiting());
    return {};
  }
  Result<std::optional<QueueState>> State(const Digest& bake) override {
    const std::lock_guard lock(mutex_);
    if (down_) return Down();
    const auto found = bakes_.find(bake);
    if (found == bakes_.end()) return std::optional<QueueState>();
    return std::optional(QueueState{found->second.Waiting(), found->second.in_flight, 1});
  }
  Status Close(const Digest& bake) override {
    const std::lock_guard lock(mutex_);
    if (!ignores_closing_) bakes_.erase(bake);
    return {};
  }

  // ---- Worker's side ----

  Result<std::vector<QueuedBake>> List() override {
    const std::lock_guard lock(mutex_);
    std::vector<QueuedBake> list;
    for (const auto& [key, bake] : bakes_) {
      if (bake.Waiting() == 0) continue;
      list.push_back(bake.about);
      for (const auto& line : bake.lines) list.back().messages.push_back(line.size());
    }
    return list;
  }
  Result<std::unique_ptr<TaskSubscription>> Subscribe(const Digest& bake) override {
    return std::unique_ptr<TaskSubscription>(std::make_unique<Subscription>(this, bake));
  }
  /// The next message of any line, in flight from now on; null: none.
  std::unique_ptr<TaskLease> Take(const Digest& bake) {
    for (uint32_t shard = 0; shard < kMaxShards; ++shard)
      if (std::unique_ptr<TaskLease> lease = Take(bake, shard)) return lease;
    return nullptr;
  }
  std::unique_ptr<TaskLease> Take(const Digest& bake, uint32_t shard) {
    const std::lock_guard lock(mutex_);
    const auto found = bakes_.find(bake);
    if (found == bakes_.end() || shard >= found->second.lines.size()) return nullptr;
    std::deque<Message>& line = found->second.lines[shard];
    if (line.empty()) return nullptr;
    Message message = line.front();
    line.pop_front();
    ++found->second.in_flight;
    ++message.deliveries;
    return std::make_unique<Lease>(this, bake, message);
  }
  std::optional<Digest> AnyBake() const {
    return bakes_.empty() ? std::nullopt : std::optional(bakes_.begin()->first);
  }
  size_t Queued() {
    const std::lock_guard lock(mutex_);
    size_t count = 0;
    for (const auto& [key, bake] : bakes_) count += bake.Waiting() + bake.in_flight;
    return count;
  }

 private:
  struct Bake {
    QueuedBake about;
    std::vector<std::deque<Message>> lines;
    uint64_t in_flight = 0;

    uint64_t Waiting() const {
      uint64_t count = 0;
      for (const auto& line : lines) count += line.size();
      return count;
    }
  };

  class Lease : public TaskLease {
   public:
    Lease(FakeQueue* queue, const Digest& bake, const Message& message)
        : queue_(queue), bake_(bake), message_(message) {}
    const TaskMessage& message() const override { return message_.task; }
    int deliveries() const override { return message_.deliveries; }
    void Extend() override {}
    void Done() override { queue_->End(bake_, &queue_->done, nullptr); }
    void Return(double) override { queue_->End(bake_, &queue_->returned, &message_); }
    void GiveUp() override { queue_->End(bake_, &queue_->given_up, nullptr); }

   private:
    FakeQueue* queue_;
    const Digest bake_;
    const Message message_;
  };

  class Subscription : public TaskSubscription {
   public:
    Subscription(FakeQueue* queue, const Digest& bake) : queue_(queue), bake_(bake) {}
    Result<std::unique_ptr<TaskLease>> Fetch(uint32_t shard, double) override {
      std::unique_ptr<TaskLease> lease = queue_->Take(bake_, shard);
      if (!lease) std::this_thread::sleep_for(std::chrono::milliseconds(2));
      return lease;
    }

   private:
    FakeQueue* queue_;
    const Digest bake_;
  };

  static Status Down() { return IoError("the queue does not answer"); }
  void End(const Digest& bake, size_t* counter, const Message* again) {
    const std::lock_guard lock(mutex_);
    ++*counter;
    const auto found = bakes_.find(bake);
    if (found == bakes_.end()) return;
    if (found->second.in_flight > 0) --found->second.in_flight;
    if (again) found->second.lines.at(again->task.shard).push_back(*again);
  }

  std::mutex mutex_;
  std::map<Digest, Bake> bakes_;
  bool down_ = false, ignores_closing_ = false;
};

}  // namespace glint
