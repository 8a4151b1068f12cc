#include "worker/home_line.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string>
#include <system_error>

#include "common/base/files.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostNameBytes = 128;

fs::path LinePath(const fs::path& bake, uint32_t line) { return bake / "homes" / std::to_string(line); }

std::string OwnName() {
  std::array<char, 64> host{};
  if (gethostname(host.data(), host.size() - 1) != 0) host[0] = 0;
  return std::string(host.data()) + ":" + std::to_string(getpid());
}

/// The locked file, or -1: another process has it, or there can be none. The lock goes when the process does,
/// however it ends.
int TryLock(const fs::path& path) {
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (fd < 0 || flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  close(fd);
  return -1;
}

/// For people to read: nothing depends on it, so nothing is lost where it fails.
void WriteName(int fd) {
  const std::string name = OwnName();
  if (ftruncate(fd, 0) != 0 || pwrite(fd, name.data(), name.size(), 0) < 0) return;
}

}  // namespace

HomeLine::HomeLine(const fs::path& bake, uint32_t lines, uint32_t seed) : line_(seed % lines) {
  std::error_code error;
  fs::create_directory(bake / "homes", error);
  for (uint32_t i = 0; i < lines && lock_ < 0; ++i) {
    const uint32_t line = (seed % lines + i) % lines;
    lock_ = TryLock(LinePath(bake, line));
    if (lock_ >= 0) line_ = line;
  }
  if (lock_ >= 0) WriteName(lock_);
}

HomeLine::~HomeLine() {
  if (lock_ >= 0) close(lock_);
}

std::string HomeName(const fs::path& bake, uint32_t line) {
  const Result<std::vector<std::byte>> read = ReadFile(LinePath(bake, line), kMostNameBytes);
  if (!read.ok()) return {};
  std::string name(reinterpret_cast<const char*>(read->data()), read->size());
  // Whatever is there goes to people's terminals.
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c <= ' ' || c > '~'; }, '?');
  return name;
}

}  // namespace glint
