#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/monitor/metrics.h"

namespace glint {

/// Something that a program cannot work without.
struct HealthCheck {
  std::string name;  ///< one word: callers see it, and not why it failed
  std::function<Status()> check;
};

/// What a program shows of itself. Called by any thread, several at a time.
struct Monitored {
  std::function<std::vector<Metric>()> metrics;
  std::vector<HealthCheck> checks;
};

/// Answers GET /metrics (ToPrometheus) and GET /healthz (200, or 503 if a check fails) over plain HTTP, until
/// it is destroyed. Whoever reaches it may read; there is nothing to write. Why a check fails is logged, once
/// for each reason.
class MonitorServer {
 public:
  /// @param listen  HOST:PORT; port 0: any
  /// kUsage: that is no address, or cannot be listened to.
  static Result<std::unique_ptr<MonitorServer>> Start(const std::string& listen, Monitored what);
  virtual ~MonitorServer() = default;
  virtual int port() const = 0;
};

}  // namespace glint
