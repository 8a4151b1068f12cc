#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/hash.h"
#include "common/base/status.h"

namespace glint {

/// What the queue carries: a hint that somebody should look at a task. Nothing is true because the queue says
/// so: messages may be lost, come twice, or come after their bake has ended.
struct TaskMessage {
  Digest manifest;  ///< of the round (common/round/round_files.h)
  uint64_t index = 0;
  uint32_t shard = 0;  ///< the bake's line that it waits in (common/queue/shard.h)

  bool operator==(const TaskMessage&) const = default;
};

/// A bake that takes part in the queue.
struct QueuedBake {
  Digest bake;
  std::string execution;     ///< ExecutionId() that its tasks need
  int priority = 1;          ///< share of the workers, relative to other bakes', 1 to kMaxPriority
  double lease_seconds = 0;  ///< a message comes again so long after the last sign of life of who has it
  uint32_t shards = 1;       ///< and as many lines that its messages wait in, 1 to kMaxShards
  std::vector<uint64_t> messages = {};  ///< in each line, waiting or with a worker; from List only
};
inline constexpr uint32_t kMaxShards = 1024;
inline constexpr int kMaxPriority = 100;

/// Where a bake's messages are.
struct QueueState {
  uint64_t waiting = 0;      ///< for a worker
  uint64_t in_flight = 0;    ///< with a worker
  uint64_t requests = 0;     ///< of workers that wait for a message
  uint64_t redelivered = 0;  ///< of those in flight: not for the first time
};

/// The queue as the coordinator sees it. Every call may be repeated. kIo: the queue does not answer; try
/// again.
class TaskPublisher {
 public:
  virtual ~TaskPublisher() = default;
  /// Makes what the bake needs in the queue, empty of messages.
  virtual Status Open(const QueuedBake& bake) = 0;
  virtual Status Publish(const Digest& bake, std::span<const TaskMessage> messages) = 0;
  /// None: the queue does not know the bake (any more), or not all of its lines.
  virtual Result<std::optional<QueueState>> State(const Digest& bake) = 0;
  /// Forgets the bake and its messages.
  virtual Status Close(const Digest& bake) = 0;
};

/// A message that a worker has. Unless one of the last three is called, it comes again.
class TaskLease {
 public:
  virtual ~TaskLease() = default;
  virtual const TaskMessage& message() const = 0;
  virtual int deliveries() const = 0;  ///< 1: for the first time
  virtual void Extend() = 0;           ///< a sign of life
  virtual void Done() = 0;
  virtual void Return(double delay_seconds) = 0;  ///< to come again, to anybody
  virtual void GiveUp() = 0;                      ///< never to come again
};

/// Messages of one bake for one thread.
class TaskSubscription {
 public:
  virtual ~TaskSubscription() = default;
  /// Waits up to `seconds` for a message of a line; null: nothing came. May give one of another line that
  /// came too late when that was asked for. kIo: the queue does not answer, or has forgotten the bake.
  virtual Result<std::unique_ptr<TaskLease>> Fetch(uint32_t shard, double seconds) = 0;
};

/// The queue as workers see it.
class TaskSource {
 public:
  virtual ~TaskSource() = default;
  /// Bakes with messages. Cheap enough for a thousand workers to ask now and then. kIo.
  virtual Result<std::vector<QueuedBake>> List() = 0;
  virtual Result<std::unique_ptr<TaskSubscription>> Subscribe(const Digest& bake) = 0;
};

}  // namespace glint
