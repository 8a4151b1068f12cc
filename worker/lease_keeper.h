#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <list>
#include <mutex>
#include <string>
#include <thread>

#include "common/queue/task_queue.h"

namespace glint {

/// Gives signs of life for the tasks at work, from a thread of its own, and sees to deadlines: a task that
/// hangs would otherwise be kept for ever by a process that is alive.
class LeaseKeeper {
 public:
  /// @param on_deadline  called once, from the keeper's thread, with what is known of a task that is past its
  ///                     deadline; that task gets no more signs of life
  explicit LeaseKeeper(std::function<void(const std::string&)> on_deadline);
  ~LeaseKeeper();

  /// Keeps a lease until it is destroyed.
  class Guard {
   public:
    ~Guard();
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;

   private:
    friend class LeaseKeeper;
    struct Entry;
    Guard(LeaseKeeper* keeper, std::list<Entry>::iterator entry) : keeper_(keeper), entry_(entry) {}
    LeaseKeeper* keeper_;
    std::list<Entry>::iterator entry_;
  };
  /// @param what              for messages
  /// @param period_seconds    between signs of life
  /// @param deadline_seconds  from now
  Guard Keep(TaskLease* lease, std::string what, double period_seconds, double deadline_seconds);

 private:
  using Clock = std::chrono::steady_clock;
  void Run();
  void Tend(Guard::Entry* entry, Clock::time_point now);

  const std::function<void(const std::string&)> on_deadline_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::list<Guard::Entry> entries_;
  bool ending_ = false;
  std::thread thread_;
};

struct LeaseKeeper::Guard::Entry {
  TaskLease* lease;
  std::string what;
  Clock::duration period;
  Clock::time_point next, deadline;
  bool overdue = false;
};

}  // namespace glint
