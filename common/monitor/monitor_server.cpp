#include "common/monitor/monitor_server.h"

#include <httplib.h>
#include <sys/socket.h>

#include <charconv>
#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "common/base/log.h"

namespace glint {
namespace {

constexpr size_t kThreads = 2;     ///< one that is scraped, and one that is probed
constexpr time_t kPatience = 5;    ///< seconds for a caller to send or take something
constexpr size_t kMaxBody = 1024;  ///< bytes that a caller may send
constexpr auto kStarting = std::chrono::milliseconds(1);

struct Address {
  std::string host;
  int port = 0;
};
/// "127.0.0.1:9464", "[::1]:9464"
std::optional<Address> ParseAddress(const std::string& text) {
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return std::nullopt;
  Address address{text.substr(0, colon), 0};
  const char* const end = text.data() + text.size();
  const auto [last, error] = std::from_chars(text.data() + colon + 1, end, address.port);
  if (error != std::errc() || last != end || address.port < 0 || address.port > 65535) return std::nullopt;
  if (address.host.front() == '[' && address.host.back() == ']')
    address.host = address.host.substr(1, address.host.size() - 2);
  return address;
}

class MonitorServerImpl : public MonitorServer {
 public:
  explicit MonitorServerImpl(Monitored what) : what_(std::move(what)) {
    http_.Get("/metrics", [this](const httplib::Request&, httplib::Response& reply) {
      reply.set_content(ToPrometheus(what_.metrics()), "text/plain; version=0.0.4; charset=utf-8");
    });
    http_.Get("/healthz", [this](const httplib::Request&, httplib::Response& reply) {
      const auto [healthy, text] = Check();
      reply.status = healthy ? 200 : 503;
      reply.set_content(text, "text/plain; charset=utf-8");
    });
    http_.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };  // the server's to delete
    http_.set_read_timeout(kPatience);
    http_.set_write_timeout(kPatience);
    http_.set_keep_alive_max_count(1);
    http_.set_payload_max_length(kMaxBody);
    // Not SO_REUSEPORT, the library's default: two programs on one port would share its callers.
    http_.set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
  }

  ~MonitorServerImpl() override {
    http_.stop();
    if (thread_.joinable()) thread_.join();
  }

  Status Listen(const std::string& listen) {
    const std::optional<Address> address = ParseAddress(listen);
    if (!address) return UsageError("'" + listen + "' is not HOST:PORT, for instance 127.0.0.1:9464");
    port_ = address->port;
    if (port_ == 0) {
      port_ = http_.bind_to_any_port(address->host);
    } else if (!http_.bind_to_port(address->host, port_)) {
      port_ = -1;
    }
    if (port_ < 0) return UsageError("cannot listen on " + listen + "; is it in use?");
    thread_ = std::thread([this] { http_.listen_after_bind(); });
    while (!http_.is_running()) std::this_thread::sleep_for(kStarting);  // or stop() would be missed
    return {};
  }
  int port() const override { return port_; }

 private:
  /// Whether all is well, and a line for each check.
  std::pair<bool, std::string> Check() {
    bool healthy = true;
    std::string text;
    for (const HealthCheck& check : what_.checks) {
      const Status status = check.check();
      Tell(check.name, status);
      healthy = healthy && status.ok();
      text += check.name + (status.ok() ? ": ok\n" : ": failed\n");
    }
    return {healthy, text};
  }

  void Tell(const std::string& name, const Status& status) {
    const std::lock_guard lock(mutex_);
    std::string& told = told_[name];
    if (told == status.message()) return;
    told = status.message();
    if (status.ok()) {
      Log(LogLevel::kNote, "healthy again: " + name, {{"check", name}});
    } else {
      Log(LogLevel::kWarning, "not healthy: " + name + ": " + told, {{"check", name}});
    }
  }

  const Monitored what_;
  httplib::Server http_;
  std::thread thread_;
  int port_ = -1;
  std::mutex mutex_;
  std::map<std::string, std::string> told_;
};

}  // namespace

Result<std::unique_ptr<MonitorServer>> MonitorServer::Start(const std::string& listen, Monitored what) {
  auto server = std::make_unique<MonitorServerImpl>(std::move(what));
  GLINT_RETURN_IF_ERROR(server->Listen(listen));
  return std::unique_ptr<MonitorServer>(std::move(server));
}

}  // namespace glint
