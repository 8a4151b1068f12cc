#include <chrono>
#include <cmath>
#include <memory>
#include <thread>

#include "common/base/log.h"
#include "common/base/memory.h"
#include "common/queue/nats_queue.h"
#include "coordinator/cluster_executor.h"
#include "coordinator/service/bake_service.h"
#include "coordinator/service/grpc_server.h"
#include "coordinator/service/service_metrics.h"
#include "tools/commands.h"
#include "tools/monitor_words.h"
#include "tools/service_words.h"

namespace glint {
namespace {

struct ServeWords {
  ServiceOptions service;
  ServerOptions server;
  NatsOptions nats;
  ClusterOptions cluster;
  MonitorWords monitor;
  std::string token_file;
  double keep_unused_hours = 168;
  bool with_workers = false;
  uint64_t memory_mib = 0, max_scene_mib = 1024;
};

/// What the service shows, and what it cannot work without.
Monitored Watched(const BakeService& service, NatsQueue* queue) {
  Monitored watched{[&service, queue] { return ServiceMetrics(service, queue); },
                    {{"store", [&service] { return service.CheckStore(); }}}};
  if (queue) watched.checks.push_back({"queue", [queue] { return queue->CheckReachable(); }});
  return watched;
}

/// Where, for whom, and within which memory.
std::string Describe(const ServeWords& words, int port) {
  std::string text = "listening on " + words.server.listen + " (port " + std::to_string(port) + "), ";
  text += words.server.cert_file.empty() ? "for programs on this machine only, unencrypted"
                                         : "for clients with a certificate";
  if (!words.token_file.empty()) text += ", by token";
  const uint64_t usable = UsableMemory() >> 20;
  text += "; may use " + std::to_string(usable) + " MiB of memory";
  if (words.with_workers) return text;
  return text + ", " + std::to_string(words.memory_mib ? words.memory_mib : usable / 4) +
         " of them for hits kept between layers";
}

ServiceOptions MakeServiceOptions(const ServeWords& words, const CommonWords& common, NatsQueue* queue) {
  ServiceOptions options = words.service;
  options.threads = common.threads;
  options.memory_bytes = words.memory_mib << 20;
  options.max_scene_bytes = words.max_scene_mib << 20;
  options.keep_unused = std::chrono::seconds(static_cast<int64_t>(std::ceil(words.keep_unused_hours * 3600)));
  if (!queue) return options;
  options.make_executor = [cluster = words.cluster, queue](const BakeRequest& request) {
    ClusterOptions own = cluster;
    own.priority = request.priority;
    return MakeClusterExecutor(queue, own);
  };
  return options;
}

Result<ServerOptions> MakeServerOptions(const ServeWords& words) {
  ServerOptions options = words.server;
  if (!words.token_file.empty()) {
    GLINT_ASSIGN_OR_RETURN(options.tokens, TokenList::Read(words.token_file));
  }
  return options;
}

Status RunServe(const ServeWords& words, const CommonWords& common) {
  SetLogFormat(words.monitor.log_format);
  std::unique_ptr<NatsQueue> queue;
  if (words.with_workers) {
    GLINT_ASSIGN_OR_RETURN(queue, NatsQueue::Connect(words.nats));
  }
  GLINT_ASSIGN_OR_RETURN(const ServerOptions options, MakeServerOptions(words));
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<BakeService> service,
                         BakeService::Open(MakeServiceOptions(words, common, queue.get())));
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<GrpcServer> server, GrpcServer::Start(options, service.get()));
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<MonitorServer> monitor,
                         StartMonitor(words.monitor, Watched(*service, queue.get())));
  Log(LogLevel::kNote, Describe(words, server->port()));
  if (common.json) PrintJson({{"port", server->port()}, {"store", words.service.store.string()}});
  while (!StopRequested()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  Log(LogLevel::kNote, "ending; bakes at work go on when the service is started again");
  return {};
}

}  // namespace

Command AddServeCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("serve", "Take bakes from clients and see them through");
  const auto words = std::make_shared<ServeWords>();
  app.add_option("--store", words->service.store, "Folder for all that the service keeps")
      ->required()
      ->check(CLI::ExistingDirectory)
      ->type_name("FOLDER");
  app.add_option("--listen", words->server.listen, "Where clients find it; port 0: any")
      ->capture_default_str()
      ->type_name("HOST:PORT");
  app.add_flag("--workers", words->with_workers,
               "Have 'glint worker's compute the tasks (--nats); without: threads of this process");
  app.add_option("--bakes", words->service.running, "Bakes at a time")
      ->check(CLI::Range(1, 64))
      ->capture_default_str()
      ->type_name("N");
  app.add_option("--max-scene", words->max_scene_mib, "MiB of a scene's file")
      ->check(CLI::Range(uint64_t{1}, uint64_t{1} << 16))
      ->capture_default_str()
      ->type_name("MIB");
  app.add_option("--memory", words->memory_mib,
                 "MiB for hits that all bakes together keep between layers; 0: a quarter of what it may use")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1} << 32))
      ->type_name("MIB");
  app.add_option("--tls-cert", words->server.cert_file, "The service's certificate (PEM)")->type_name("FILE");
  app.add_option("--tls-key", words->server.key_file, "The key of that certificate (PEM)")->type_name("FILE");
  app.add_option("--tls-client-ca", words->server.client_ca_file,
                 "Certificate that clients' are signed with (PEM)")
      ->type_name("FILE");
  app.add_option("--token-file", words->token_file,
                 "Clients that may call, as 'glint token' prints them; without: whoever is let in")
      ->check(CLI::ExistingFile)
      ->type_name("FILE");
  app.add_option(
         "--keep-unused", words->keep_unused_hours,
         "Hours that what no bake refers to stays in the store after it was last touched; 0: for ever")
      ->check(NumberRange(0, 1e6))
      ->capture_default_str()
      ->type_name("H");
  AddNatsWords(app, words->nats);
  AddLeaseWord(app, words->cluster);
  AddMonitorWords(app, words->monitor);
  AddCommonWords(app, common);
  app.footer(
      "Killed at any moment, the same command goes on with every bake.\n"
      "\n"
      "Examples:\n"
      "  glint serve --store bakes\n"
      "  glint serve --store /shared/bakes --workers --nats nats://queue:4222");
  return [words, &common] { return RunServe(*words, common); };
}

}  // namespace glint
