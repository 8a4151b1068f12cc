#pragma once

#include <atomic>
#include <cstdint>

#include "common/base/steady_clock.h"

namespace glint {

/// What a worker has done so far, for whoever watches it: any thread, at any time.
struct WorkerMeter {
  std::atomic<uint64_t> computed{0}, found{0}, returned{0}, given_up{0};  ///< tasks, as in WorkerCounts
  std::atomic<uint64_t> redelivered{0};  ///< messages that somebody had had before
  std::atomic<int> busy{0};              ///< threads with a task
  // Of tasks that were computed in this process:
  std::atomic<uint64_t> rays{0};
  std::atomic<double> round_seconds{0};    ///< until a round's input was there, by the thread that read it
  std::atomic<double> gather_seconds{0};   ///< of all threads
  std::atomic<double> publish_seconds{0};  ///< of all threads
};

/// Adds the seconds since it was made to a meter's, if there is one.
class MeteredSpan {
 public:
  explicit MeteredSpan(std::atomic<double>* seconds) : seconds_(seconds) {}
  ~MeteredSpan() {
    if (seconds_) *seconds_ += watch_.Seconds();
  }
  MeteredSpan(const MeteredSpan&) = delete;
  MeteredSpan& operator=(const MeteredSpan&) = delete;

 private:
  std::atomic<double>* const seconds_;
  const Stopwatch watch_;
};

}  // namespace glint
