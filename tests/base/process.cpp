#include "tests/base/process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <fstream>
#include <iterator>
#include <thread>

#include "tests/base/temp_folder.h"

namespace glint {
namespace {

std::string ReadText(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<char*> Pointers(std::vector<std::string>& strings) {
  std::vector<char*> pointers;
  pointers.reserve(strings.size() + 1);
  for (std::string& s : strings) pointers.push_back(s.data());
  pointers.push_back(nullptr);
  return pointers;
}

/// The new process, or -1.
pid_t Spawn(const std::vector<std::string>& command, const std::vector<std::string>& environment,
            const std::string& out, const std::string& err) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  const int flags = O_WRONLY | O_CREAT | O_APPEND;
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), flags, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, err.c_str(), flags, 0600);
  std::vector<std::string> arguments = command;
  std::vector<std::string> variables = environment;  // first: getenv takes the first of two
  for (char** variable = environ; *variable != nullptr; ++variable) variables.emplace_back(*variable);
  pid_t pid = -1;
  const int error = posix_spawn(&pid, arguments[0].c_str(), &actions, nullptr, Pointers(arguments).data(),
                                Pointers(variables).data());
  posix_spawn_file_actions_destroy(&actions);
  return error == 0 ? pid : -1;
}

/// Waits for the process to end, or for the moment to send it its signal and then for its end. Its status.
int Await(pid_t pid, const ProcessSignal& stop) {
  int status = 0;
  bool pending = stop.signal != 0;
  for (;;) {
    const pid_t ended = waitpid(pid, &status, pending ? WNOHANG : 0);
    if (ended == pid) return status;
    if (ended < 0 && errno != EINTR) return -1;
    if (!pending) continue;
    if (stop.when()) {
      kill(pid, stop.signal);
      pending = false;
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
}

}  // namespace

ProcessResult RunProcess(const std::vector<std::string>& command, const std::vector<std::string>& environment,
                         const ProcessSignal& stop) {
  const TempFolder folder;
  const std::string out = (folder / "out").string(), err = (folder / "err").string();
  ProcessResult result;
  const pid_t pid = Spawn(command, environment, out, err);
  if (pid < 0) {
    result.exit_code = 127;
    return result;
  }
  const int status = Await(pid, stop);
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
  result.out = ReadText(out);
  result.err = ReadText(err);
  return result;
}

BackgroundProcess::BackgroundProcess(const std::vector<std::string>& command,
                                     const std::filesystem::path& log,
                                     const std::vector<std::string>& environment)
    : pid_(Spawn(command, environment, log.string(), log.string())), ended_(pid_ < 0) {}

BackgroundProcess::~BackgroundProcess() {
  Signal(SIGKILL);
  Wait();
}

void BackgroundProcess::Signal(int signal) const {
  if (!ended_) kill(pid_, signal);
}

bool BackgroundProcess::Running() {
  if (!ended_) ended_ = waitpid(pid_, &status_, WNOHANG) == pid_;
  return !ended_;
}

int BackgroundProcess::Wait() {
  while (!ended_) {
    const pid_t waited = waitpid(pid_, &status_, 0);
    ended_ = waited == pid_ || (waited < 0 && errno != EINTR);
  }
  return WIFSIGNALED(status_) ? -WTERMSIG(status_) : WEXITSTATUS(status_);
}

}  // namespace glint
