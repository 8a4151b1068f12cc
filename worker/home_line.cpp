#include "worker/home_line.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <string>
#include <system_error>

namespace glint {
namespace {

namespace fs = std::filesystem;

/// The locked file, or -1: another process has it, or there can be none. The lock goes when the process does,
/// however it ends.
int TryLock(const fs::path& path) {
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (fd < 0 || flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  close(fd);
  return -1;
}

}  // namespace

HomeLine::HomeLine(const fs::path& bake, uint32_t lines, uint32_t seed) : line_(seed % lines) {
  const fs::path homes = bake / "homes";
  std::error_code error;
  fs::create_directory(homes, error);
  for (uint32_t i = 0; i < lines && lock_ < 0; ++i) {
    const uint32_t line = (seed % lines + i) % lines;
    lock_ = TryLock(homes / std::to_string(line));
    if (lock_ >= 0) line_ = line;
  }
}

HomeLine::~HomeLine() {
  if (lock_ >= 0) close(lock_);
}

}  // namespace glint
