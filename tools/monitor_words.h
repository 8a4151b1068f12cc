#pragma once

#include <functional>
#include <memory>
#include <string>

#include "common/base/log.h"
#include "common/monitor/monitor_server.h"
#include "tools/options.h"

namespace glint {

/// How a program that runs for long is watched.
struct MonitorWords {
  std::string listen;  ///< HOST:PORT; empty: nowhere
  LogFormat log_format = LogFormat::kText;
};

void AddMonitorWords(CLI::App& app, MonitorWords& words);
/// Begins what the words ask for; null: they ask for no server. Errors: those of MonitorServer::Start.
Result<std::unique_ptr<MonitorServer>> StartMonitor(const MonitorWords& words, Monitored what);

}  // namespace glint
