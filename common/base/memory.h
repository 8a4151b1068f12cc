#pragma once

#include <cstdint>
#include <filesystem>

namespace glint {

/// Bytes of memory that this process may use: the machine's or, where that is less, the lowest limit of its
/// control groups (version 1 or 2) and those above them, as containers and systemd set them.
/// @param root  where /proc and /sys are; tests have their own
uint64_t UsableMemory(const std::filesystem::path& root = "/");

/// Bytes of memory that this process occupies.
uint64_t ResidentMemory();

}  // namespace glint
