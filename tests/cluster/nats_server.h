#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "tests/base/process.h"

namespace glint {

/// A NATS server of the test's own, with JetStream in a folder that outlives it.
class NatsServer {
 public:
  explicit NatsServer(const std::filesystem::path& folder);
  /// With deploy/nats.conf and keys that deploy/certificates.sh made.
  NatsServer(const std::filesystem::path& folder, const std::filesystem::path& keys);

  std::string url() const { return scheme_ + "127.0.0.1:" + std::to_string(port_); }
  void Start();
  /// As `kill -9` does.
  void Kill();
  /// Kill, and the loss of all it had stored.
  void KillAndForget();

 private:
  const std::filesystem::path folder_;
  const int port_;
  const std::string scheme_;
  const std::filesystem::path config_;
  std::vector<std::string> environment_;
  std::unique_ptr<BackgroundProcess> process_;
};

/// Keys and certificates of an authority of the test's own, in a new folder (deploy/certificates.sh).
void MakeCertificates(const std::filesystem::path& folder);

/// A TCP port of 127.0.0.1 that nobody listens to.
int FreePort();

}  // namespace glint
