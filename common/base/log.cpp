#include "common/base/log.h"

#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string_view>

namespace glint {
namespace {

std::atomic<LogLevel> max_level{LogLevel::kProgress};
std::mutex output_mutex;
bool progress_shown = false;  // guarded by output_mutex: the terminal's last line is a progress line

std::atomic<bool> stop_requested{false};
std::atomic<bool> signal_seen{false};
static_assert(std::atomic<bool>::is_always_lock_free, "the signal handler needs it");

bool IsAnimated() {
  static const bool animated = [] {
    const char* term = std::getenv("TERM");
    return isatty(STDERR_FILENO) == 1 && term != nullptr && std::string_view(term) != "dumb";
  }();
  return animated;
}

bool IsColoured() {
  static const bool coloured = [] {
    const char* no_color = std::getenv("NO_COLOR");
    return IsAnimated() && (no_color == nullptr || *no_color == '\0');
  }();
  return coloured;
}

std::string Prefix(LogLevel level) {
  switch (level) {
    case LogLevel::kError:
      return IsColoured() ? "\033[31merror:\033[0m " : "error: ";
    case LogLevel::kWarning:
      return IsColoured() ? "\033[33mwarning:\033[0m " : "warning: ";
    case LogLevel::kNote:
      return "note: ";
    case LogLevel::kProgress:
      return "progress: ";
  }
  return "";
}

void HandleStopSignal(int signal) {
  stop_requested = true;
  if (!signal_seen.exchange(true)) return;
  // The second one: as if there were no handler, so that the parent sees which signal it was.
  struct sigaction action = {};
  action.sa_handler = SIG_DFL;
  sigaction(signal, &action, nullptr);
  raise(signal);
}

}  // namespace

void SetLogLevel(LogLevel level) { max_level = level; }

void Log(LogLevel level, const std::string& message) {
  if (level > max_level.load()) return;
  const bool in_place = level == LogLevel::kProgress && IsAnimated();
  const std::string line = (in_place ? message : Prefix(level) + message + '\n');
  const std::lock_guard lock(output_mutex);
  if (progress_shown) std::fputs("\r\033[K", stderr);
  std::fwrite(line.data(), 1, line.size(), stderr);
  std::fflush(stderr);
  progress_shown = in_place;
}

bool StopRequested() { return stop_requested.load(std::memory_order_relaxed); }
void RequestStop() { stop_requested = true; }
void ClearStop() {
  stop_requested = false;
  signal_seen = false;
}

void InstallStopHandler() {
  struct sigaction action = {};
  action.sa_handler = HandleStopSignal;
  action.sa_flags = SA_RESTART;  // a write in progress goes on
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

}  // namespace glint
