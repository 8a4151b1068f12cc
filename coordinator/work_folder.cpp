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

Status WorkFolder::Remove() {
  const int lock = std::exchange(lock_, -1);
  if (flock(lock, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno;
    close(lock);
    if (error == EWOULDBLOCK) return {};  // the other bake removes it
    return Failed(store_.root(), "lock it, so it stays; remove it once no bake needs it", error);
  }
  std::error_code error;
  for (const char* part : {"chunks", "tasks", "rounds", "plans", "inputs", "failed"}) {
    fs::remove_all(store_.root() / part, error);
    if (error) break;
  }
  // The lock last: until it is gone, a bake of the same key waits for it. Folders only if they are empty.
  if (!error) fs::remove(store_.root() / kLockName, error);
  rmdir(store_.root().c_str());
  rmdir(root_.c_str());
  close(lock);
  return error ? Failed(store_.root(), "remove the work folder", error.value()) : Status();
}

}  // namespace glint
