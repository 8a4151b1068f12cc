#include "tests/cluster/nats_server.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <thread>

namespace glint {
namespace {

sockaddr_in Loopback(int port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(port));
  return address;
}

bool Listens(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = Loopback(port);
  const bool connected = connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  close(fd);
  return connected;
}

}  // namespace

int FreePort() {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof address;
  const bool bound = bind(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0 &&
                     getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) == 0;
  close(fd);
  return bound ? ntohs(address.sin_port) : 0;
}

void MakeCertificates(const std::filesystem::path& folder) {
  const ProcessResult made =
      RunProcess({"/bin/sh", GLINT_SOURCE_DIR "/deploy/certificates.sh", folder.string()});
  ASSERT_EQ(made.exit_code, 0) << made.err;
}

NatsServer::NatsServer(const std::filesystem::path& folder)
    : folder_(folder), port_(FreePort()), scheme_("nats://"), config_(folder / "nats.conf") {
  std::filesystem::create_directories(folder_);
  std::ofstream(config_) << "listen: 127.0.0.1:" << port_ << "\njetstream { store_dir: \""
                         << (folder_ / "js").string() << "\", max_memory_store: 64M, max_file_store: 1G }\n";
  Start();
}

NatsServer::NatsServer(const std::filesystem::path& folder, const std::filesystem::path& keys)
    : folder_(folder),
      port_(FreePort()),
      scheme_("tls://"),
      config_(GLINT_SOURCE_DIR "/deploy/nats.conf"),
      environment_{
          "GLINT_NATS_LISTEN=127.0.0.1:" + std::to_string(port_),
          "GLINT_NATS_STORE=" + (folder / "js").string(), "GLINT_NATS_CERT=" + (keys / "nats.pem").string(),
          "GLINT_NATS_KEY=" + (keys / "nats.key").string(), "GLINT_NATS_CA=" + (keys / "ca.pem").string()} {
  std::filesystem::create_directories(folder_);
  Start();
}

void NatsServer::Start() {
  process_ = std::make_unique<BackgroundProcess>(
      std::vector<std::string>{GLINT_NATS_SERVER, "-c", config_.string()}, folder_ / "log", environment_);
  for (int i = 0; i < 1000 && !Listens(port_); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

void NatsServer::Kill() { process_.reset(); }

void NatsServer::KillAndForget() {
  Kill();
  std::filesystem::remove_all(folder_ / "js");
}

}  // namespace glint
