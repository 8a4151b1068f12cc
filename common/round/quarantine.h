#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "common/base/hash.h"
#include "common/base/status.h"

namespace glint {

/// Why workers gave a task up.
struct QuarantineRecord {
  uint64_t task = 0;  ///< index in its round
  int layer = 0;
  int deliveries = 0;
  std::string reason;        ///< "ended by signal 11 (Segmentation fault)"
  std::string error_output;  ///< the end of what it said last
  std::string command;       ///< that repeats it
};

/// Publishes the record in the bake's folder. kIo.
Status WriteQuarantine(const std::filesystem::path& bake, const Digest& task_key,
                       const QuarantineRecord& record);
/// None: the task is not given up. A record that cannot be read still is one.
std::optional<QuarantineRecord> ReadQuarantine(const std::filesystem::path& bake, const Digest& task_key);
/// The task may be tried again.
void ForgetQuarantine(const std::filesystem::path& bake, const Digest& task_key);

}  // namespace glint
