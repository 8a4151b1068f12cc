#pragma once

#include <memory>
#include <optional>
#include <string>

#include "common/base/status.h"
#include "coordinator/service/access.h"
#include "coordinator/service/bake_service.h"

namespace glint {

/// Where a service listens and whom it believes.
struct ServerOptions {
  std::string listen = "127.0.0.1:7117";  ///< HOST:PORT; port 0: any
  std::string cert_file, key_file;        ///< PEM; both or neither: without, only on loopback
  std::string client_ca_file;  ///< PEM; needed with the two above: clients show a certificate of it
  /// Clients that may call, by their tokens ("authorization: Bearer TOKEN"); none: whoever is let in may do
  /// everything.
  std::optional<TokenList> tokens;
};

/// The network side of a BakeService (proto/glint.proto), until it is destroyed.
class GrpcServer {
 public:
  /// kUsage: the options cannot be, or the address cannot be listened to; kBadInput: a file of keys.
  static Result<std::unique_ptr<GrpcServer>> Start(const ServerOptions& options, BakeService* service);
  virtual ~GrpcServer() = default;
  virtual int port() const = 0;
};

}  // namespace glint
