#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include "common/domain/bake_settings.h"
#include "common/queue/task_queue.h"

namespace glint {

// How long a worker waits, in seconds:
inline constexpr double kFetchSeconds = 1;     ///< where a task may come, when none is known to wait, ...
inline constexpr double kProbeSeconds = 0.05;  ///< ... and where one is said to be
inline constexpr double kListSeconds = 0.1;    ///< between two questions what waits where

/// The bake that a worker turns to: any, in proportion to their priorities. `bakes` is not empty.
size_t ChooseBake(std::span<const QueuedBake> bakes, std::mt19937* random);

/// Which of a bake's lines a worker asks for its next task. In the first layer lines are parts of the surface
/// (common/queue/shard.h): it begins at its own, its home, and when a line is empty goes on with one of the
/// longest. What it has computed waits at its home in later layers, so that it finds its hits in memory; when
/// that is done, it helps where most is left. Thread-safe.
class LineChooser {
 public:
  /// @param home  < lines
  /// @param seed  the worker's own: what is equally good is chosen unlike others
  LineChooser(uint32_t lines, uint32_t home, uint64_t seed);

  struct Choice {
    uint32_t line = 0;
    bool waits =
        false;  ///< tasks are thought to wait there; else the queue should be asked, or a round begin
  };
  /// @param now  seconds, of any clock that is the same in all calls
  Choice Choose(double now);
  /// How many messages are in each line, as the queue says; some may be with workers.
  void Update(std::span<const uint64_t> messages, double now);
  /// A task of a round, the first of which begins it, came from a line.
  void Took(const TaskMessage& task, int layer);
  /// A task took so long.
  void Finished(double seconds);
  /// None came from a line: the messages that it has are with workers.
  void FoundEmpty(uint32_t line);

 private:
  struct Line {
    uint64_t messages = 0;
    uint64_t taken = 0;  ///< of its messages, so many are with workers
    double changed = 0;  ///< when its length was last seen to change
    uint64_t Waiting() const { return messages - std::min(messages, taken); }
  };
  std::optional<uint32_t> Pick(const std::function<double(const Line&)>& weight);
  double Help(const Line& line, double now) const;
  bool StandsStill(const Line& line, double now) const;

  std::mutex mutex_;
  const uint32_t home_;
  std::mt19937_64 random_;
  std::vector<Line> lines_;
  Digest round_;         ///< manifest of the last task
  uint32_t next_;        ///< the line to go on with, ...
  bool goes_on_ = true;  ///< ... unless it has been found empty
  bool home_is_empty_ = false;
  bool first_layer_ = true;
  double task_seconds_ = 0;  ///< that the last one took
  bool looks_around_ = false;
  bool known_ = false;  ///< what the queue said has not been overtaken by a task of some seconds
};

}  // namespace glint
