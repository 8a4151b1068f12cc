#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <random>
#include <span>
#include <vector>

#include "common/domain/bake_settings.h"
#include "common/queue/task_queue.h"

namespace glint {

// How long a worker waits, in seconds:
inline constexpr double kFetchSeconds = 1;    ///< where a task may come, when none is known to wait, ...
inline constexpr double kProbeSeconds = 0.2;  ///< ... and where one is said to be
inline constexpr double kListSeconds = 0.1;   ///< between two questions what waits where

/// The bake that a worker turns to: any, in proportion to their priorities. `bakes` is not empty.
size_t ChooseBake(std::span<const QueuedBake> bakes, std::mt19937* random);

/// Which of a bake's lines a worker asks for its next task: first those whose vertices it has traced, then
/// the longest one, so that at a round's end everybody helps where most is left. Thread-safe.
class ShardChooser {
 public:
  /// @param seed  the worker's own: what is equally good is chosen unlike others
  ShardChooser(uint32_t shards, uint64_t seed);

  struct Choice {
    uint32_t shard = 0;
    bool waits = false;  ///< tasks are thought to wait there; else one may come again there, or a round begin
  };
  Choice Choose() const;
  /// How many messages are in each line, as the queue says; some may be with workers.
  void Update(std::span<const uint64_t> messages);
  /// A task came. What was known to wait is forgotten when it is the first one of a round.
  void Took(const TaskMessage& task);
  /// None came from a line: the messages that it has are with workers, and others may have been faster
  /// elsewhere too, so that all that was known to wait is forgotten.
  void FoundEmpty(uint32_t shard);
  /// The block's vertices, of `vertices` in all, were computed here: their hits are in memory.
  void Keep(const GatherBlock& block, uint32_t vertices);

 private:
  void Forget();
  struct Shard {
    uint64_t messages = 0;
    uint64_t taken = 0;  ///< of its messages, so many are with workers
    uint64_t kept = 0;   ///< vertices
    uint64_t order = 0;
    uint64_t Waiting() const { return messages - std::min(messages, taken); }
  };

  mutable std::mutex mutex_;
  std::vector<Shard> shards_;
  std::vector<bool> kept_;  ///< by vertex
  Digest round_;            ///< manifest of the last task
};

}  // namespace glint
