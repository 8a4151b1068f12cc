#pragma once

#include <filesystem>

#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/store/store.h"

namespace glint {

/// A bake's share of a work folder: the sub-folder named by the bake's key. Nothing else in the work folder
/// is ever touched, so that it may be anybody's folder and serve any number of bakes at once. Bakes of one
/// key share the sub-folder; a lock on its file `lock` tells the last one.
class WorkFolder {
 public:
  /// Makes what is missing of ROOT/KEY. kIo, naming the path.
  static Result<WorkFolder> Open(const std::filesystem::path& root, const Digest& bake_key);
  WorkFolder(WorkFolder&& other) noexcept;
  WorkFolder& operator=(WorkFolder&&) = delete;
  ~WorkFolder();

  ChunkStore& store() { return store_; }
  /// Removes ROOT/KEY unless a bake is at work on it; false: one is. One that begins meanwhile waits, and
  /// then begins anew. kIo: something could not be removed.
  static Result<bool> RemoveUnused(const std::filesystem::path& root, const Digest& bake_key);
  /// Removes the chunks, unless another bake is at work on them, and with `root_too` the work folder if
  /// nothing else is in it. kIo: something could not be removed.
  Status Remove(bool root_too);

 private:
  WorkFolder(std::filesystem::path root, ChunkStore store, int lock)
      : root_(std::move(root)), store_(std::move(store)), lock_(lock) {}

  std::filesystem::path root_;
  ChunkStore store_;
  int lock_ = -1;  ///< -1: given back
};

}  // namespace glint
