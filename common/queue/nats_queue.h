#pragma once

#include <memory>
#include <string>

#include "common/base/status.h"
#include "common/queue/task_queue.h"

namespace glint {

/// Of workers: what they need to be allowed to subscribe to (docs/service.md).
inline constexpr char kWorkerInbox[] = "_INBOX_WORKER";

/// How to reach NATS.
struct NatsOptions {
  std::string url = "nats://127.0.0.1:4222";  ///< several, separated by commas, for a cluster of servers
  std::string ca_file;                        ///< PEM; any of the three files: the connection is encrypted
  std::string cert_file, key_file;            ///< PEM, of this client; both or neither
  /// Where answers come in. Workers have one of their own, so that they need not be allowed to read others'.
  std::string inbox = "_INBOX";
  int replicas = 1;  ///< copies of the stream; 3 in a cluster of three servers
};

/// The queue on NATS JetStream: stream BAKE with subjects bake.<key>.task, one durable pull consumer a bake,
/// named by its key, whose description says what workers need to know. Connects in the background and again
/// whenever the connection is lost; until then calls give kIo.
class NatsQueue : public TaskPublisher, public TaskSource {
 public:
  /// kUsage: the options cannot be (files, URL).
  static Result<std::unique_ptr<NatsQueue>> Connect(const NatsOptions& options);
  /// kIo: the server does not answer. Needs no rights there.
  virtual Status CheckReachable() = 0;
};

}  // namespace glint
