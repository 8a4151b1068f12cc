#pragma once

#include <nats/nats.h>

#include <atomic>
#include <memory>
#include <string>

#include "common/base/status.h"
#include "common/queue/nats_queue.h"

namespace glint {

/// Frees what libnats gives, each by its own function.
template <auto destroy>
struct NatsDeleter {
  template <class T>
  void operator()(T* object) const {
    destroy(object);
  }
};
template <class T, auto destroy>
using NatsHandle = std::unique_ptr<T, NatsDeleter<destroy>>;

/// A connection to NATS with its JetStream context.
class NatsConnection {
 public:
  static Result<std::shared_ptr<NatsConnection>> Open(const NatsOptions& options);
  ~NatsConnection();
  NatsConnection(const NatsConnection&) = delete;
  NatsConnection& operator=(const NatsConnection&) = delete;

  jsCtx* js() const { return js_.get(); }
  /// Asks the server for a sign of life. kIo: none came.
  Status CheckReachable() const;
  /// kIo with the server's address.
  Status Failed(const std::string& what, natsStatus status) const;
  /// Messages that were published and refused, or not confirmed in time, since the last call.
  uint64_t TakeRefused() { return refused_.exchange(0); }

 private:
  explicit NatsConnection(std::string url) : url_(std::move(url)) {}
  Status Connect(const NatsOptions& options);

  const std::string url_;  ///< without passwords
  std::atomic<uint64_t> refused_{0};
  NatsHandle<natsConnection, natsConnection_Destroy> connection_;
  NatsHandle<jsCtx, jsCtx_Destroy> js_;
};

}  // namespace glint
