#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>

namespace glint::test {

/// A file of the shared test data (GLINT_SHARED_DATA, or shared/data beside the source tree); nothing, and a
/// note, when it is not there.
inline std::optional<std::filesystem::path> SharedData(const std::string& relative) {
  std::filesystem::path root;
  if (const char* set = std::getenv("GLINT_SHARED_DATA"))
    root = set;
  else
    root = std::filesystem::path(GLINT_SOURCE_DIR).parent_path() / "shared" / "data";
  if (std::filesystem::exists(root / relative)) return root / relative;
  std::cout << "note: " << relative << " is not among the shared test data; this check is left out\n";
  return std::nullopt;
}

/// A fresh path in the folder for temporary files, removed at the end.
class TemporaryPath {
 public:
  explicit TemporaryPath(const std::string& name)
      : path_(std::filesystem::temp_directory_path() / ("glint_" + std::to_string(::getpid()) + "_" + name)) {
  }
  TemporaryPath(const TemporaryPath&) = delete;
  TemporaryPath& operator=(const TemporaryPath&) = delete;
  ~TemporaryPath() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  const std::filesystem::path& get() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace glint::test
