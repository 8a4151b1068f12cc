#pragma once

#include <string>
#include <vector>

namespace glint {

/// How a process ended, and what it wrote.
struct ProcessResult {
  int exit_code = -1;  ///< -1: it was ended by `signal`
  int signal = 0;
  std::string out, err;
};

/// Runs `command` (program, arguments) to its end with `environment` ("NAME=value") added to this process's,
/// standard input empty. exit_code 127: the program could not be started.
ProcessResult RunProcess(const std::vector<std::string>& command,
                         const std::vector<std::string>& environment = {});

}  // namespace glint
