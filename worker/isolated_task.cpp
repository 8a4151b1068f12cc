#include "worker/isolated_task.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>

namespace glint {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kKeptOutput = 4096;  ///< bytes
constexpr auto kPoll = std::chrono::milliseconds(20);

/// Reads what is there; keeps the end.
void Drain(int fd, std::string* output) {
  char buffer[1024];
  for (;;) {
    const ssize_t got = read(fd, buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return;
    output->append(buffer, static_cast<size_t>(got));
    if (output->size() > kKeptOutput) output->erase(0, output->size() - kKeptOutput);
  }
}

/// @return 0, or errno
int Spawn(const std::vector<std::string>& command, int error_fd, pid_t* pid) {
  std::vector<std::string> words = command;
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, error_fd, STDERR_FILENO);
  const int error = posix_spawn(pid, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

/// Waits for the process's end, collecting its output. True: the deadline ended it.
bool Await(pid_t pid, int output_fd, Clock::time_point deadline, std::string* output, int* wait_status) {
  bool killed = false;
  while (waitpid(pid, wait_status, WNOHANG) == 0) {
    Drain(output_fd, output);
    if (!killed && Clock::now() >= deadline) {
      kill(pid, SIGKILL);
      killed = true;
    }
    std::this_thread::sleep_for(kPoll);
  }
  Drain(output_fd, output);
  return killed;
}

Status Describe(int wait_status, bool killed) {
  if (killed) return InternalError("did not end before its deadline and was killed");
  if (WIFSIGNALED(wait_status)) {
    const int number = WTERMSIG(wait_status);
    return InternalError("ended by signal " + std::to_string(number) + " (" + strsignal(number) + ")");
  }
  const int code = WEXITSTATUS(wait_status);
  if (code == 0) return {};
  const bool known = code <= static_cast<int>(ErrorKind::kMismatch);
  return {known ? static_cast<ErrorKind>(code) : ErrorKind::kInternal, "exit code " + std::to_string(code)};
}

}  // namespace

std::vector<std::string> RunTaskCommand(const std::filesystem::path& program,
                                        const std::filesystem::path& bake,
                                        const std::filesystem::path& manifest, size_t index) {
  return {program,     "run-task", "--manifest", manifest, "--store", bake, "--index", std::to_string(index),
          "--threads", "1",        "--quiet"};
}

std::string ShellLine(const std::vector<std::string>& command) {
  std::string line;
  for (const std::string& word : command) {
    line += line.empty() ? "" : " ";
    const bool plain = !word.empty() && word.find_first_not_of(
                                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                            "0123456789_./:=-") == std::string::npos;
    if (plain) {
      line += word;
      continue;
    }
    line += '\'';
    for (const char c : word) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += '\'';
  }
  return line;
}

CommandEnd RunCommand(const std::vector<std::string>& command, double deadline_seconds) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0)
    return {IoError("cannot make a pipe: " + std::generic_category().message(errno)), ""};
  pid_t pid = 0;
  const int error = Spawn(command, ends[1], &pid);
  close(ends[1]);
  CommandEnd end;
  if (error != 0) {
    end.status = IoError(command[0] + ": cannot start: " + std::generic_category().message(error));
  } else {
    const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                             std::chrono::duration<double>(deadline_seconds));
    int wait_status = 0;
    const bool killed = Await(pid, ends[0], deadline, &end.error_output, &wait_status);
    end.status = Describe(wait_status, killed);
  }
  close(ends[0]);
  return end;
}

}  // namespace glint
