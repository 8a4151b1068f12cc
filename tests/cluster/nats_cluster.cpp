#include "tests/cluster/nats_cluster.h"

#include <fstream>
#include <sstream>
#include <vector>

#include "tests/cluster/nats_server.h"

namespace glint {

NatsCluster::NatsCluster(const std::filesystem::path& folder) : folder_(folder) {
  for (int& port : client_port_) port = FreePort();
  for (int& port : route_port_) port = FreePort();
  std::string routes;
  for (const int port : route_port_)
    routes +=
        (routes.empty() ? "nats-route://127.0.0.1:" : ", nats-route://127.0.0.1:") + std::to_string(port);
  for (int node = 0; node < kNodes; ++node) {
    const auto n = static_cast<size_t>(node);
    std::filesystem::create_directories(Folder(node));
    std::ofstream(Folder(node) / "nats.conf")
        << "server_name: s" << node << "\nlisten: 127.0.0.1:" << client_port_[n]
        << "\njetstream { store_dir: \"" << (Folder(node) / "js").string()
        << "\", max_memory_store: 64M, max_file_store: 1G }\ncluster { name: bake, listen: 127.0.0.1:"
        << route_port_[n] << ", routes: [" << routes << " ] }\n";
    Start(node);
  }
}

std::string NatsCluster::url() const {
  std::string urls;
  for (const int port : client_port_)
    urls += (urls.empty() ? "nats://127.0.0.1:" : ",nats://127.0.0.1:") + std::to_string(port);
  return urls;
}

void NatsCluster::Start(int node) {
  process_[static_cast<size_t>(node)] = std::make_unique<BackgroundProcess>(
      std::vector<std::string>{GLINT_NATS_SERVER, "-c", (Folder(node) / "nats.conf").string()},
      Folder(node) / "log");
}

int NatsCluster::StreamLeader() const {
  int leader = -1;
  std::string latest;
  for (int node = 0; node < kNodes; ++node) {
    std::ifstream log(Folder(node) / "log");
    for (std::string line; std::getline(log, line);) {
      const bool elected = line.find("new stream leader for '$G > BAKE'") != std::string::npos;
      // "[pid] 2026/01/01 00:00:00.000000 [INF] ...": the text of a time sorts as the time does.
      const std::string when = elected ? line.substr(line.find(' ')) : "";
      if (elected && when > latest) {
        latest = when;
        leader = node;
      }
    }
  }
  return leader;
}

}  // namespace glint
