#include "coordinator/service/store_garbage.h"

#include <algorithm>
#include <system_error>

namespace glint {
namespace {

namespace fs = std::filesystem;

/// Results and records lie two folders below the bake's: chunks/ab/<digest>.
constexpr int kResultDepth = 1;

}  // namespace

std::vector<fs::path> FilesOlderThan(const fs::path& folder, FileTime before) {
  std::vector<fs::path> old;
  std::error_code error;
  for (fs::recursive_directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) {
    std::error_code gone;
    if (i->symlink_status(gone).type() != fs::file_type::regular) continue;
    const FileTime written = i->last_write_time(gone);
    if (!gone && written < before) old.push_back(i->path());
  }
  return old;
}

// Whatever is renamed into a folder changes the folder's own time.
FileTime LastChange(const fs::path& bake_folder) {
  std::error_code error;
  FileTime newest = fs::last_write_time(bake_folder, error);
  for (fs::recursive_directory_iterator i(bake_folder, error), end; !error && i != end; i.increment(error)) {
    std::error_code gone;
    if (i.depth() == kResultDepth) i.disable_recursion_pending();
    const FileTime changed = i->last_write_time(gone);
    if (!gone) newest = std::max(newest, changed);
  }
  return newest;
}

uint64_t BytesIn(const fs::path& path) {
  std::error_code error;
  if (fs::is_regular_file(path, error)) return fs::file_size(path, error);
  uint64_t bytes = 0;
  for (fs::recursive_directory_iterator i(path, error), end; !error && i != end; i.increment(error)) {
    std::error_code gone;
    const uint64_t size = i->is_regular_file(gone) ? i->file_size(gone) : 0;
    if (!gone) bytes += size;
  }
  return bytes;
}

}  // namespace glint
