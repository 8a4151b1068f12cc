#include "tools/monitor_words.h"

#include <utility>

namespace glint {

void AddMonitorWords(CLI::App& app, MonitorWords& words) {
  const std::string group = "Operation";
  app.add_option(
         "--metrics-listen", words.listen,
         "Where /metrics (Prometheus) and /healthz are, over plain HTTP; port 0: any (default: nowhere)")
      ->type_name("HOST:PORT")
      ->group(group);
  AddChoice<LogFormat>(app, "--log-format", words.log_format,
                       {{"text", LogFormat::kText}, {"json", LogFormat::kJson}},
                       "Lines on standard error: text (default), or JSON objects")
      ->group(group);
}

Result<std::unique_ptr<MonitorServer>> StartMonitor(const MonitorWords& words, Monitored what) {
  if (words.listen.empty()) return std::unique_ptr<MonitorServer>();
  GLINT_ASSIGN_OR_RETURN(std::unique_ptr<MonitorServer> server,
                         MonitorServer::Start(words.listen, std::move(what)));
  Log(LogLevel::kNote, "metrics and health on " + words.listen + " (port " + std::to_string(server->port()) +
                           "), for whoever reaches it");
  return server;
}

}  // namespace glint
