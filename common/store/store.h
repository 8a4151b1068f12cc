#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "common/base/hash.h"
#include "common/base/status.h"

namespace glint {

/// What is noted of a finished task for whoever plans the next round; no result depends on it.
struct TaskNote {
  double seconds = 0;            ///< of processor time that it took; kept to the microsecond
  std::optional<uint32_t> home;  ///< line of the queue that its worker waits at (common/queue/shard.h)
};

/// Content-addressed chunks on a file system, and the record of which task's result each one is. Layout under
/// root:
///   chunks/ab/<digest>   the blob: header (magic, version, payload bytes, XXH3 of the payload), payload; the
///                        digest is the SHA-256 of the payload
///   tasks/ab/<key>       the digest of the task's result, what is noted of it, and the XXH3 of both
/// Everything is published by write, fsync, rename, fsync of the folder. Any number of threads and processes
/// may share a root: two that finish one task write the same bytes.
class ChunkStore {
 public:
  static Result<ChunkStore> Open(const std::filesystem::path& root);

  /// Digest of the task's result, if it is finished and its chunk is there.
  std::optional<Digest> FindResult(const Digest& task_key) const;
  /// None: the task is not finished.
  std::optional<TaskNote> FindNote(const Digest& task_key) const;
  /// Publishes the payload, then the task's record. Safe to repeat.
  Result<Digest> PutResult(const Digest& task_key, std::span<const std::byte> payload,
                           const TaskNote& note = {});
  /// Payload of a chunk; header, length, checksum and digest are checked. kBadInput with the file's name if
  /// it is damaged or gone; kIo if it is there and cannot be read, which says nothing about it.
  Result<std::vector<std::byte>> Get(const Digest& digest) const;
  /// Forgets a task's record and removes its chunk if it is damaged, so that the task is computed again. A
  /// chunk that cannot be read stays (kIo).
  Status Discard(const Digest& task_key, const Digest& digest);

  const std::filesystem::path& root() const { return root_; }

 private:
  explicit ChunkStore(std::filesystem::path root) : root_(std::move(root)) {}
  std::filesystem::path root_;
};

}  // namespace glint
