#pragma once

#include <sys/types.h>

#include <filesystem>
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

/// A process that runs beside the test; killed, if it still runs, and waited for on destruction.
class BackgroundProcess {
 public:
  /// Standard output and error are appended to `log`.
  BackgroundProcess(const std::vector<std::string>& command, const std::filesystem::path& log,
                    const std::vector<std::string>& environment = {});
  ~BackgroundProcess();
  BackgroundProcess(const BackgroundProcess&) = delete;
  BackgroundProcess& operator=(const BackgroundProcess&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal) const;
  bool Running();
  /// Waits for its end; its exit code, or minus the signal that ended it.
  int Wait();

 private:
  pid_t pid_ = -1;
  int status_ = -1;
  bool ended_ = false;
};

}  // namespace glint
