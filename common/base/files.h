#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "common/base/status.h"

namespace glint {

/// Publishes `bytes` at `path`: temporary in the same folder, write, fsync, rename, fsync of the folder. A
/// reader sees the old file, or the new one, never a part of it. Errors: kIo, naming the path.
Status PublishFile(const std::filesystem::path& path, std::span<const std::byte> bytes);

/// The same for a file that is written in pieces: Write() them in order, then Commit(). Without Commit the
/// temporary is removed; one whose process was killed is removed by the next Create() for the same path.
class FilePublisher {
 public:
  static Result<FilePublisher> Create(const std::filesystem::path& path);
  FilePublisher(FilePublisher&&) noexcept;
  FilePublisher& operator=(FilePublisher&&) = delete;
  ~FilePublisher();

  Status Write(std::span<const std::byte> bytes);
  /// Bytes written so far.
  uint64_t offset() const { return offset_; }
  /// Makes what is written durable.
  Status Sync();
  /// Puts the file in place. Once; nothing may be written after it.
  Status Commit();

 private:
  FilePublisher() = default;
  std::filesystem::path path_, temp_;
  int fd_ = -1;  ///< locked as long as the temporary is there
  uint64_t offset_ = 0;
};

/// Whether PublishFile could put a file at `path`: tries it in the folder, leaving `path` as it is. kUsage if
/// `path` names something else than a file or its folder is not there, kIo if it cannot be written.
Status CheckPublishable(const std::filesystem::path& path);

/// Whether files can be written in `folder`: writes, syncs and removes one. kIo, naming the folder.
Status CheckWritable(const std::filesystem::path& folder);

/// Removes what a killed process left half written, of FilePublisher's: true if `path` was that. A file that
/// somebody still writes, and one with any other name, stays.
bool RemoveOrphan(const std::filesystem::path& path);

/// Makes the folder and those above it that are missing, and makes each new name durable. kIo, naming the
/// path.
Status CreateFolders(const std::filesystem::path& folder);

/// Whole file, refusing more than `max_bytes` (kLimit) and absent or unreadable files (kBadInput).
Result<std::vector<std::byte>> ReadFile(const std::filesystem::path& path, uint64_t max_bytes);

/// A read-only memory mapping of a whole file; empty for an empty file.
class MappedFile {
 public:
  static Result<MappedFile> Open(const std::filesystem::path& path);
  MappedFile() = default;
  MappedFile(MappedFile&&) noexcept;
  MappedFile& operator=(MappedFile&&) noexcept;
  ~MappedFile();
  std::span<const std::byte> bytes() const { return {data_, size_}; }

 private:
  const std::byte* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace glint
