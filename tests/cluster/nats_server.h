#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "tests/base/process.h"

namespace glint {

/// A NATS server of the test's own, with JetStream in a folder that outlives it.
class NatsServer {
 public:
  explicit NatsServer(const std::filesystem::path& folder);

  std::string url() const { return "nats://127.0.0.1:" + std::to_string(port_); }
  void Start();
  /// As `kill -9` does.
  void Kill();
  /// Kill, and the loss of all it had stored.
  void KillAndForget();

 private:
  const std::filesystem::path folder_;
  const int port_;
  std::unique_ptr<BackgroundProcess> process_;
};

/// A TCP port of 127.0.0.1 that nobody listens to.
int FreePort();

}  // namespace glint
