#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/status.h"

namespace glint {

/// How a command ended.
struct CommandEnd {
  Status status;             ///< its exit code as a kind; kInternal if a signal or the deadline ended it
  std::string error_output;  ///< the end of what it wrote to standard error
};

/// The command that computes one task in a process of its own.
std::vector<std::string> RunTaskCommand(const std::filesystem::path& program,
                                        const std::filesystem::path& bake,
                                        const std::filesystem::path& manifest, size_t index);
/// The command as one line for a shell.
std::string ShellLine(const std::vector<std::string>& command);

/// Runs a command to its end, or kills it at the deadline.
CommandEnd RunCommand(const std::vector<std::string>& command, double deadline_seconds);

}  // namespace glint
