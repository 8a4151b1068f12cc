#include "common/base/log.h"

#include <signal.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string_view>

namespace glint {
namespace {

std::atomic<LogLevel> max_level{LogLevel::kProgress};
std::atomic<LogFormat> log_format{LogFormat::kText};
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

struct LevelWord {
  const char *name, *colour;
};
constexpr std::array<LevelWord, 4> kLevels = {
    {{"error", "\033[31m"}, {"warning", "\033[33m"}, {"note", ""}, {"progress", ""}}};

std::string Prefix(LogLevel level) {
  const auto& [name, colour] = kLevels[static_cast<size_t>(level)];
  const bool coloured = *colour != '\0' && IsColoured();
  return coloured ? std::string(colour) + name + ":\033[0m " : std::string(name) + ": ";
}

/// UTC, ISO 8601, to the millisecond.
std::string TimeText() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto milliseconds = std::chrono::duration_cast<std::chrono::milliseconds>(now).count();
  const std::time_t seconds = milliseconds / 1000;
  std::tm utc = {};
  gmtime_r(&seconds, &utc);
  char date[32], text[40];
  std::strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", &utc);
  std::snprintf(text, sizeof text, "%s.%03dZ", date, static_cast<int>(milliseconds % 1000));
  return text;
}

std::string JsonLine(LogLevel level, const std::string& message, std::initializer_list<LogField> fields) {
  nlohmann::ordered_json line = {
      {"time", TimeText()}, {"level", kLevels[static_cast<size_t>(level)].name}, {"message", message}};
  for (const LogField& field : fields) line[std::string(field.name)] = field.value;
  // A name in another encoding than UTF-8 must not lose the line.
  return line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + '\n';
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

void SetLogFormat(LogFormat format) { log_format = format; }

void Log(LogLevel level, const std::string& message, std::initializer_list<LogField> fields) {
  if (level > max_level.load()) return;
  const bool json = log_format.load() == LogFormat::kJson;
  const bool in_place = !json && level == LogLevel::kProgress && IsAnimated();
  const std::string line = json       ? JsonLine(level, message, fields)
                           : in_place ? message
                                      : Prefix(level) + message + '\n';
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
