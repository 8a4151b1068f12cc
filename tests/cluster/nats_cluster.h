#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>

#include "tests/base/process.h"

namespace glint {

/// Three NATS servers that know each other, each with a folder of its own for JetStream.
class NatsCluster {
 public:
  static constexpr int kNodes = 3;
  explicit NatsCluster(const std::filesystem::path& folder);

  /// All of them, separated by commas.
  std::string url() const;
  void Start(int node);
  /// As `kill -9` does.
  void Kill(int node) { process_[static_cast<size_t>(node)].reset(); }
  /// Which of them leads JetStream's stream BAKE, by its own log; -1: none says so.
  int StreamLeader() const;

 private:
  std::filesystem::path Folder(int node) const { return folder_ / ("node" + std::to_string(node)); }

  const std::filesystem::path folder_;
  std::array<int, kNodes> client_port_, route_port_;
  std::array<std::unique_ptr<BackgroundProcess>, kNodes> process_;
};

}  // namespace glint
