#include "common/queue/nats_connection.h"

#include <utility>
#include <vector>

#include "common/base/log.h"

namespace glint {
namespace {

constexpr int64_t kReconnectMs = 250;
constexpr int64_t kApiWaitMs = 3000;
constexpr int64_t kSignOfLifeMs = 2000;
constexpr int64_t kMaxUnconfirmed = 4096;

/// libnats wants the addresses one by one.
std::vector<std::string> SplitAddresses(const std::string& urls) {
  std::vector<std::string> parts;
  size_t begin = 0;
  for (;;) {
    const size_t comma = urls.find(',', begin);
    parts.push_back(urls.substr(begin, comma - begin));
    if (comma == std::string::npos) return parts;
    begin = comma + 1;
  }
}

/// "nats://user:password@host:1" -> "nats://host:1", for messages.
std::string WithoutPasswords(const std::string& urls) {
  std::string text;
  for (const std::string& url : SplitAddresses(urls)) {
    const size_t scheme = url.find("://"), at = url.rfind('@');
    const size_t host = scheme == std::string::npos ? 0 : scheme + 3;
    text += text.empty() ? "" : ",";
    text += at == std::string::npos ? url : url.substr(0, host) + url.substr(at + 1);
  }
  return text;
}

Status CheckFiles(const NatsOptions& options) {
  if (options.cert_file.empty() == options.key_file.empty()) return {};
  return UsageError("a client's certificate and its key for NATS go together: give both or neither");
}

// libnats waits for ever for a first connection unless it has somebody to tell.
void OnFirstConnection(natsConnection*, void*) {}

void OnLost(natsConnection*, void*) {}

/// libnats prints errors of subscriptions to standard error unless somebody takes them; all of them come back
/// from the calls that they concern.
void OnError(natsConnection*, natsSubscription*, natsStatus, void*) {}

void OnRefused(jsCtx*, jsPubAckErr*, void* counter) { ++*static_cast<std::atomic<uint64_t>*>(counter); }

natsStatus ApplySecurity(const NatsOptions& options, natsOptions* out) {
  natsStatus s = NATS_OK;
  if (options.ca_file.empty() && options.cert_file.empty()) return s;
  s = natsOptions_SetSecure(out, true);
  if (s == NATS_OK && !options.ca_file.empty())
    s = natsOptions_LoadCATrustedCertificates(out, options.ca_file.c_str());
  if (s == NATS_OK && !options.cert_file.empty())
    s = natsOptions_LoadCertificatesChain(out, options.cert_file.c_str(), options.key_file.c_str());
  return s;
}

natsStatus ApplyReconnecting(natsOptions* out) {
  natsStatus s = natsOptions_SetMaxReconnect(out, -1);
  if (s == NATS_OK) s = natsOptions_SetReconnectWait(out, kReconnectMs);
  if (s == NATS_OK) s = natsOptions_SetRetryOnFailedConnect(out, true, OnFirstConnection, nullptr);
  if (s == NATS_OK) s = natsOptions_SetDisconnectedCB(out, OnLost, nullptr);
  if (s == NATS_OK) s = natsOptions_SetErrorHandler(out, OnError, nullptr);
  // An answer that cannot come any more need not be waited for.
  if (s == NATS_OK) s = natsOptions_SetFailRequestsOnDisconnect(out, true);
  return s;
}

}  // namespace

Result<std::shared_ptr<NatsConnection>> NatsConnection::Open(const NatsOptions& options) {
  GLINT_RETURN_IF_ERROR(CheckFiles(options));
  std::shared_ptr<NatsConnection> connection(new NatsConnection(WithoutPasswords(options.url)));
  GLINT_RETURN_IF_ERROR(connection->Connect(options));
  return connection;
}

Status NatsConnection::Connect(const NatsOptions& options) {
  natsOptions* made = nullptr;
  natsStatus s = natsOptions_Create(&made);
  const NatsHandle<natsOptions, natsOptions_Destroy> nats(made);
  const std::vector<std::string> addresses = SplitAddresses(options.url);
  std::vector<const char*> servers;
  servers.reserve(addresses.size());
  for (const std::string& address : addresses) servers.push_back(address.c_str());
  if (s == NATS_OK) s = natsOptions_SetServers(made, servers.data(), static_cast<int>(servers.size()));
  if (s == NATS_OK) s = natsOptions_SetName(made, "glint " GLINT_VERSION);
  if (s == NATS_OK) s = natsOptions_SetCustomInboxPrefix(made, options.inbox.c_str());
  // Else the client waits a millisecond for more to send, twice for each task.
  if (s == NATS_OK) s = natsOptions_SetSendAsap(made, true);
  if (s == NATS_OK) s = ApplySecurity(options, made);
  if (s == NATS_OK) s = ApplyReconnecting(made);
  if (s != NATS_OK) {
    const char* detail = nats_GetLastError(nullptr);
    return UsageError("NATS at " + url_ + ": " + (detail ? detail : natsStatus_GetText(s)) +
                      "; check the address and the files of keys");
  }
  natsConnection* connection = nullptr;
  s = natsConnection_Connect(&connection, made);
  connection_.reset(connection);
  if (s == NATS_NOT_YET_CONNECTED) {
    Log(LogLevel::kWarning, "NATS at " + url_ + " does not answer yet; trying again until it does");
  } else if (s != NATS_OK) {
    return Failed("connect", s);
  }
  jsOptions js_options;
  jsOptions_Init(&js_options);
  js_options.Wait = kApiWaitMs;
  js_options.PublishAsync.MaxPending = kMaxUnconfirmed;
  js_options.PublishAsync.StallWait = kApiWaitMs;
  js_options.PublishAsync.ErrHandler = OnRefused;
  js_options.PublishAsync.ErrHandlerClosure = &refused_;
  jsCtx* js = nullptr;
  s = natsConnection_JetStream(&js, connection, &js_options);
  js_.reset(js);
  return s == NATS_OK ? Status() : Failed("use JetStream", s);
}

NatsConnection::~NatsConnection() {
  // First, so that no handler runs on what is about to go.
  if (connection_) natsConnection_Close(connection_.get());
}

Status NatsConnection::CheckReachable() const {
  const bool connected = natsConnection_Status(connection_.get()) == NATS_CONN_STATUS_CONNECTED;
  const natsStatus s = connected ? natsConnection_FlushTimeout(connection_.get(), kSignOfLifeMs)
                                 : NATS_CONNECTION_DISCONNECTED;
  return s == NATS_OK ? Status() : Failed("get a sign of life", s);
}

Status NatsConnection::Failed(const std::string& what, natsStatus status) const {
  const char* detail =
      status == NATS_ERR ? nats_GetLastError(nullptr) : nullptr;  // of this thread's last call
  return IoError("NATS at " + url_ + ": cannot " + what + ": " +
                 (detail ? detail : natsStatus_GetText(status)));
}

}  // namespace glint
