#pragma once

#include <functional>
#include <string>
#include <vector>

namespace glint {

/// How a process ended, and what it wrote.
struct ProcessResult {
  int exit_code = -1;  ///< -1: it was ended by `signal`
  int signal = 0;
  std::string out, err;
};

/// A signal to send to a running process as soon as `when` (asked every millisecond) says so; once.
struct ProcessSignal {
  int signal = 0;  ///< 0: none
  std::function<bool()> when;
};

/// Runs `command` (program, arguments) to its end with `environment` ("NAME=value") added to this process's,
/// standard input empty. exit_code 127: the program could not be started.
ProcessResult RunProcess(const std::vector<std::string>& command,
                         const std::vector<std::string>& environment = {}, const ProcessSignal& stop = {});

}  // namespace glint
