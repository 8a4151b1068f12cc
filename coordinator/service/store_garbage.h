#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace glint {

using FileTime = std::filesystem::file_time_type;

/// Regular files in `folder` and below that were last written before `before`. What cannot be read is left
/// out: it will be there the next time.
std::vector<std::filesystem::path> FilesOlderThan(const std::filesystem::path& folder, FileTime before);

/// When a file was last put into the folder of a bake (coordinator/work_folder.h), or taken out of it.
FileTime LastChange(const std::filesystem::path& bake_folder);

/// Bytes of a file, or of all files in a folder.
uint64_t BytesIn(const std::filesystem::path& path);

}  // namespace glint
