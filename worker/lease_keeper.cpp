#include "worker/lease_keeper.h"

#include <algorithm>
#include <utility>

namespace glint {
namespace {

using Clock = std::chrono::steady_clock;

Clock::duration Seconds(double seconds) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace

LeaseKeeper::LeaseKeeper(std::function<void(const std::string&)> on_deadline)
    : on_deadline_(std::move(on_deadline)), thread_([this] { Run(); }) {}

LeaseKeeper::~LeaseKeeper() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

LeaseKeeper::Guard LeaseKeeper::Keep(TaskLease* lease, std::string what, double period_seconds,
                                     double deadline_seconds) {
  const Clock::time_point now = Clock::now();
  const Clock::duration period = Seconds(period_seconds);
  const std::lock_guard lock(mutex_);
  entries_.push_front({lease, std::move(what), period, now + period, now + Seconds(deadline_seconds)});
  changed_.notify_all();
  return {this, entries_.begin()};
}

// Waits for a sign of life that is just being given.
LeaseKeeper::Guard::~Guard() {
  const std::lock_guard lock(keeper_->mutex_);
  keeper_->entries_.erase(entry_);
}

void LeaseKeeper::Tend(Guard::Entry* entry, Clock::time_point now) {
  if (!entry->overdue && now >= entry->deadline) {
    entry->overdue = true;
    on_deadline_(entry->what);
  }
  if (entry->overdue || now < entry->next) return;
  entry->lease->Extend();
  entry->next = now + entry->period;
}

void LeaseKeeper::Run() {
  std::unique_lock lock(mutex_);
  while (!ending_) {
    const Clock::time_point now = Clock::now();
    Clock::time_point next = now + std::chrono::hours(1);
    for (Guard::Entry& entry : entries_) {
      Tend(&entry, now);
      if (!entry.overdue) next = std::min({next, entry.next, entry.deadline});
    }
    changed_.wait_until(lock, next);
  }
}

}  // namespace glint
