#include "common/base/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/base/crash_point.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

std::string ErrnoText(int error) { return std::generic_category().message(error); }

/// Closes on every way out.
struct Descriptor {
  int fd = -1;
  ~Descriptor() {
    if (fd >= 0) close(fd);
  }
};

int OpenRetrying(const fs::path& path, int flags, mode_t mode = 0) {
  int fd = -1;
  do {
    fd = open(path.c_str(), flags | O_CLOEXEC, mode);
  } while (fd < 0 && errno == EINTR);
  return fd;
}

fs::path FolderOf(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

/// Names no file that this process has used before; other processes are told apart by O_EXCL.
fs::path NextTemporary(const fs::path& path) {
  static std::atomic<uint64_t> counter{0};
  return FolderOf(path) / ("." + path.filename().string() + "." + std::to_string(getpid()) + "." +
                           std::to_string(counter++) + ".tmp");
}

/// Takes ".NUMBER" off the end of `name`.
bool TakeNumber(std::string_view& name) {
  const size_t dot = name.rfind('.');
  const bool number = dot != std::string_view::npos && dot + 1 < name.size() &&
                      name.find_first_not_of("0123456789", dot + 1) == std::string_view::npos;
  if (number) name.remove_suffix(name.size() - dot);
  return number;
}

/// The file that `name` is a temporary of, as NextTemporary names them; empty: none.
std::string_view FileOfTemporary(std::string_view name) {
  constexpr std::string_view kEnd = ".tmp";
  if (!name.starts_with('.') || !name.ends_with(kEnd)) return {};
  name.remove_suffix(kEnd.size());
  return TakeNumber(name) && TakeNumber(name) ? name.substr(1) : std::string_view();
}

/// Whether the open file is still what its name stands for.
bool IsAt(int fd, const fs::path& path) {
  struct stat open_file = {}, named = {};
  return fstat(fd, &open_file) == 0 && lstat(path.c_str(), &named) == 0 && open_file.st_dev == named.st_dev &&
         open_file.st_ino == named.st_ino;
}

/// Removes what killed processes left of earlier attempts at `path`. Whatever fails stays: it stands in
/// nobody's way.
void RemoveOrphans(const fs::path& path) {
  std::error_code error;
  const std::string file = path.filename().string();
  for (fs::directory_iterator i(FolderOf(path), error), end; !error && i != end; i.increment(error)) {
    const std::string name = i->path().filename().string();
    if (FileOfTemporary(name) == file) RemoveOrphan(i->path());
  }
}

/// A new, locked, empty file beside `path`. Remove it before closing `fd`.
struct Temporary {
  fs::path path;
  int fd = -1;
};
Result<Temporary> OpenTemporary(const fs::path& path) {
  int error = EEXIST;
  for (int attempt = 0; attempt < 1000; ++attempt) {
    const fs::path temp = NextTemporary(path);
    const int fd = OpenRetrying(temp, O_RDWR | O_CREAT | O_EXCL, 0666);
    if (fd < 0) {
      error = errno;
      if (error == EEXIST) continue;
      break;
    }
    // Between these two calls it looked like an orphan. A file system without locks has no orphans removed.
    const bool taken = flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    if (!taken && IsAt(fd, temp)) return Temporary{temp, fd};
    unlink(temp.c_str());
    close(fd);
  }
  return IoError(path.string() + ": cannot create a file in this folder: " + ErrnoText(error));
}

Status SyncFolder(const fs::path& folder) {
  const Descriptor folder_fd{OpenRetrying(folder, O_RDONLY | O_DIRECTORY)};
  if (folder_fd.fd < 0) return IoError(folder.string() + ": cannot open the folder: " + ErrnoText(errno));
  // Some network file systems refuse to sync a folder (EINVAL); their rename is as durable as it gets.
  if (fsync(folder_fd.fd) != 0 && errno != EINVAL) {
    return IoError(folder.string() + ": cannot sync the folder: " + ErrnoText(errno));
  }
  return {};
}

/// Opens a regular file for reading and finds its size.
Result<uint64_t> OpenRegular(const fs::path& path, Descriptor& file) {
  file.fd = OpenRetrying(path, O_RDONLY | O_NONBLOCK);  // non-blocking: a named pipe must not hang us
  if (file.fd < 0) return BadInput(path.string() + ": cannot open: " + ErrnoText(errno));
  struct stat info = {};
  if (fstat(file.fd, &info) != 0) return BadInput(path.string() + ": cannot inspect: " + ErrnoText(errno));
  if (!S_ISREG(info.st_mode)) return BadInput(path.string() + ": not a regular file");
  return static_cast<uint64_t>(info.st_size);
}

}  // namespace

Status PublishFile(const fs::path& path, std::span<const std::byte> bytes) {
  GLINT_ASSIGN_OR_RETURN(FilePublisher publisher, FilePublisher::Create(path));
  GLINT_RETURN_IF_ERROR(publisher.Write(bytes));
  return publisher.Commit();
}

Result<FilePublisher> FilePublisher::Create(const fs::path& path) {
  if (!path.has_filename()) return IoError("'" + path.string() + "': not the name of a file to write");
  RemoveOrphans(path);  // first: they may fill the disk
  GLINT_ASSIGN_OR_RETURN(const Temporary temporary, OpenTemporary(path));
  FilePublisher publisher;
  publisher.path_ = path;
  publisher.temp_ = temporary.path;
  publisher.fd_ = temporary.fd;
  CrashPoint("before-write");
  return publisher;
}

Status CheckPublishable(const fs::path& path) {
  if (!path.has_filename()) return UsageError("'" + path.string() + "': not the name of a file to write");
  std::error_code error;
  if (!fs::is_directory(FolderOf(path), error)) {
    return UsageError(path.string() + ": there is no folder '" + FolderOf(path).string() +
                      "'; make it first");
  }
  const fs::file_type type = fs::status(path, error).type();
  if (type != fs::file_type::regular && type != fs::file_type::not_found && type != fs::file_type::none) {
    return UsageError(path.string() + ": is there and not a file; choose another name");
  }
  GLINT_ASSIGN_OR_RETURN(const Temporary temporary, OpenTemporary(path));
  unlink(temporary.path.c_str());
  close(temporary.fd);
  return {};
}

Status CheckWritable(const fs::path& folder) {
  constexpr size_t kTrialBytes = 4096;  // a full disk still takes a file without bytes
  GLINT_ASSIGN_OR_RETURN(FilePublisher trial, FilePublisher::Create(folder / "trial"));
  GLINT_RETURN_IF_ERROR(trial.Write(std::vector<std::byte>(kTrialBytes)));
  return trial.Sync();
}

// A temporary is locked while its process lives; unlike the process number in its name, that also holds for
// processes in other containers and on other machines.
bool RemoveOrphan(const fs::path& path) {
  const std::string name = path.filename().string();
  if (FileOfTemporary(name).empty()) return false;
  const Descriptor orphan{OpenRetrying(path, O_RDWR | O_NONBLOCK | O_NOFOLLOW)};
  return orphan.fd >= 0 && flock(orphan.fd, LOCK_EX | LOCK_NB) == 0 && IsAt(orphan.fd, path) &&
         unlink(path.c_str()) == 0;
}

FilePublisher::FilePublisher(FilePublisher&& other) noexcept
    : path_(std::move(other.path_)),
      temp_(std::exchange(other.temp_, {})),
      fd_(std::exchange(other.fd_, -1)),
      offset_(other.offset_) {}

FilePublisher::~FilePublisher() {
  if (!temp_.empty()) unlink(temp_.c_str());
  if (fd_ >= 0) close(fd_);
}

Status FilePublisher::Write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(fd_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return IoError(path_.string() + ": cannot write: " + ErrnoText(errno));
    bytes = bytes.subspan(static_cast<size_t>(written));
    offset_ += static_cast<uint64_t>(written);
  }
  return {};
}

Status FilePublisher::Sync() {
  return fsync(fd_) == 0 ? Status() : IoError(path_.string() + ": cannot sync to disk: " + ErrnoText(errno));
}

Status FilePublisher::Commit() {
  CrashPoint("after-write");
  GLINT_RETURN_IF_ERROR(Sync());
  // A network file system may report a failed write as late as on closing. A duplicate is closed, so that the
  // temporary stays locked until it has its name.
  const int duplicate = fcntl(fd_, F_DUPFD_CLOEXEC, 0);
  if (duplicate < 0 || close(duplicate) != 0)
    return IoError(path_.string() + ": cannot close: " + ErrnoText(errno));
  CrashPoint("before-rename");
  if (rename(temp_.c_str(), path_.c_str()) != 0) {
    return IoError(path_.string() + ": cannot put the written file in place: " + ErrnoText(errno));
  }
  temp_.clear();
  close(std::exchange(fd_, -1));
  CrashPoint("after-rename");
  GLINT_RETURN_IF_ERROR(SyncFolder(FolderOf(path_)));
  CrashPoint("after-dir-fsync");
  return {};
}

Status CreateFolders(const fs::path& folder) {
  std::error_code error;
  if (folder.empty() || fs::is_directory(folder, error)) return {};
  const fs::path above = FolderOf(folder.has_filename() ? folder : folder.parent_path());
  GLINT_RETURN_IF_ERROR(CreateFolders(above));
  if (mkdir(folder.c_str(), 0777) != 0 && errno != EEXIST) {
    return IoError(folder.string() + ": cannot make the folder: " + ErrnoText(errno));
  }
  if (!fs::is_directory(folder, error)) return IoError(folder.string() + ": exists and is not a folder");
  return SyncFolder(above);
}

Result<std::vector<std::byte>> ReadFile(const fs::path& path, uint64_t max_bytes) {
  Descriptor file;
  GLINT_ASSIGN_OR_RETURN(const uint64_t size, OpenRegular(path, file));
  if (size > max_bytes) {
    return LimitExceeded(path.string() + ": " + std::to_string(size) + " bytes, more than the limit of " +
                         std::to_string(max_bytes));
  }
  std::vector<std::byte> bytes(size);
  size_t filled = 0;
  while (filled < bytes.size()) {
    const ssize_t got = read(file.fd, bytes.data() + filled, bytes.size() - filled);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return BadInput(path.string() + ": cannot read: " + ErrnoText(errno));
    if (got == 0) return BadInput(path.string() + ": became shorter while it was read");
    filled += static_cast<size_t>(got);
  }
  return bytes;
}

Result<MappedFile> MappedFile::Open(const fs::path& path) {
  Descriptor file;
  GLINT_ASSIGN_OR_RETURN(const uint64_t size, OpenRegular(path, file));
  MappedFile mapped;
  if (size == 0) return mapped;
  void* data = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.fd, 0);
  if (data == MAP_FAILED) return IoError(path.string() + ": cannot map into memory: " + ErrnoText(errno));
  mapped.data_ = static_cast<const std::byte*>(data);
  mapped.size_ = size;
  return mapped;
}

MappedFile::MappedFile(MappedFile&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}

MappedFile& MappedFile::operator=(MappedFile&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  return *this;
}

MappedFile::~MappedFile() {
  if (data_ != nullptr) munmap(const_cast<std::byte*>(data_), size_);  // munmap's signature is not const
}

}  // namespace glint
