#pragma once

#include <atomic>
#include <initializer_list>
#include <string>
#include <string_view>

namespace glint {

/// Severity of a message to the user. Notes and warnings go to standard error; results go to standard output.
enum class LogLevel { kError = 0, kWarning = 1, kNote = 2, kProgress = 3 };

/// Messages above this level are dropped. `--quiet` sets kError.
void SetLogLevel(LogLevel level);

/// For people, or for programs: one JSON object a line, {"time": (UTC), "level", "message", fields...}.
enum class LogFormat { kText, kJson };
void SetLogFormat(LogFormat format);

/// What a message is about. Text has it in its words and does not show it again.
struct LogField {
  std::string_view name;
  std::string value;
};
/// Writes one line, prefixed with the level's word, to standard error. Thread-safe. On a terminal a progress
/// line is replaced by the next message; the words are coloured there unless NO_COLOR is set.
void Log(LogLevel level, const std::string& message, std::initializer_list<LogField> fields = {});

/// True once the user asked to stop (SIGINT or SIGTERM after InstallStopHandler). Long loops look at it.
bool StopRequested();
void RequestStop();
/// For tests: forget an earlier request.
void ClearStop();
/// Makes SIGINT and SIGTERM ask for a stop; the second one ends the process at once.
void InstallStopHandler();

}  // namespace glint
