#include "coordinator/work_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "common/base/files.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLockName = "lock";

Status Failed(const fs::path& path, const char* what, int error) {
  return IoError(path.string() + ": cannot " + what + ": " + std::generic_category().message(error));
}

/// Waits for the lock. A file system without locks gives none: then nothing is removed in the end.
Status LockShared(int fd, const fs::path& path) {
  while (flock(fd, LOCK_SH) != 0) {
    if (errno == ENOLCK || errno == EOPNOTSUPP || errno == EINVAL) return {};
    if (errno != EINTR) return Failed(path, "lock the file", errno);
  }
  return {};
}

bool IsAt(int fd, const fs::path& path) {
  struct stat open_file = {}, named = {};
  return fstat(fd, &open_file) == 0 && stat(path.c_str(), &named) == 0 && open_file.st_dev == named.st_dev &&
         open_file.st_ino == named.st_ino;
}

/// Locks the folder for itself alone, to remove it; false: a bake is at work on it.
Result<bool> LockForRemoval(int fd, const fs::path& folder) {
  if (flock(fd, LOCK_EX | LOCK_NB) == 0) return true;
  if (errno == EWOULDBLOCK) return false;
  return Failed(folder, "lock it, so it stays; remove it once no bake needs it", errno);
}

/// What bakes put into `folder`, which is locked, and the folder itself if it is empty then.
Status RemoveContents(const fs::path& folder) {
  std::error_code error;
  for (const char* part : {"chunks", "tasks", "rounds", "plans", "inputs", "failed", "homes"}) {
    fs::remove_all(folder / part, error);
    if (error) break;
  }
  // The lock last: until it is gone, a bake of the same key waits for it.
  if (!error) fs::remove(folder / kLockName, error);
  rmdir(folder.c_str());
  return error ? Failed(folder, "remove the work folder", error.value()) : Status();
}

constexpr int kAttempts = 100;

/// The lock of `folder`, shared; both are made if they are not there.
Result<int> OpenLock(const fs::path& folder) {
  const fs::path path = folder / kLockName;
  int error = 0;
  // The bake before may take lock and folders away between any two of these calls.
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    if (const Status made = CreateFolders(folder); !made.ok()) {
      if (attempt == kAttempts - 1) return made;
      continue;
    }
    const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    error = errno;
    if (fd < 0 && error != ENOENT && error != EINTR) break;
    if (fd < 0) continue;
    const Status locked = LockShared(fd, path);
    if (locked.ok() && IsAt(fd, path)) return fd;
    close(fd);
    GLINT_RETURN_IF_ERROR(locked);
  }
  return Failed(path, "open the file", error);
}

}  // namespace

Result<WorkFolder> WorkFolder::Open(const fs::path& root, const Digest& bake_key) {
  const fs::path folder = root / bake_key.Hex();
  GLINT_ASSIGN_OR_RETURN(const int lock, OpenLock(folder));
  Result<ChunkStore> store = ChunkStore::Open(folder);
  if (!store.ok()) {
    close(lock);
    return store.status();
  }
  return WorkFolder(root, std::move(store).value(), lock);
}

WorkFolder::WorkFolder(WorkFolder&& other) noexcept
    : root_(std::move(other.root_)), store_(std::move(other.store_)), lock_(std::exchange(other.lock_, -1)) {}

WorkFolder::~WorkFolder() {
  if (lock_ >= 0) close(lock_);
}

Status WorkFolder::Remove(bool root_too) {
  const int lock = std::exchange(lock_, -1);
  const Result<bool> alone = LockForRemoval(lock, store_.root());
  Status removed = alone.status();
  if (alone.ok() && *alone) {  // otherwise the other bake removes it
    removed = RemoveContents(store_.root());
    if (root_too) rmdir(root_.c_str());  // only if it is empty
  }
  close(lock);
  return removed;
}

Result<bool> WorkFolder::RemoveUnused(const fs::path& root, const Digest& bake_key) {
  const fs::path folder = root / bake_key.Hex(), path = folder / kLockName;
  const int lock = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (lock < 0 && errno == ENOENT) return true;
  if (lock < 0) return Failed(path, "open the file", errno);
  Result<bool> unused = LockForRemoval(lock, folder);
  if (unused.ok() && *unused) unused = IsAt(lock, path);
  if (unused.ok() && *unused) {
    if (const Status removed = RemoveContents(folder); !removed.ok()) unused = removed;
  }
  close(lock);
  return unused;
}

}  // namespace glint
