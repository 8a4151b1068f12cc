#include <chrono>
#include <memory>
#include <thread>

#include "common/base/log.h"
#include "common/queue/nats_queue.h"
#include "coordinator/cluster_executor.h"
#include "coordinator/service/bake_service.h"
#include "coordinator/service/grpc_server.h"
#include "tools/commands.h"
#include "tools/service_words.h"

namespace glint {
namespace {

struct ServeWords {
  ServiceOptions service;
  ServerOptions server;
  NatsOptions nats;
  ClusterOptions cluster;
  bool with_workers = false;
  uint64_t memory_mib = 0, max_scene_mib = 1024;
};

Status RunServe(const ServeWords& words, const CommonWords& common) {
  ServiceOptions options = words.service;
  options.threads = common.threads;
  options.memory_bytes = words.memory_mib << 20;
  options.max_scene_bytes = words.max_scene_mib << 20;
  std::unique_ptr<NatsQueue> queue;
  if (words.with_workers) {
    GLINT_ASSIGN_OR_RETURN(queue, NatsQueue::Connect(words.nats));
    options.make_executor = [&words, &queue](const BakeRequest& request) {
      ClusterOptions cluster = words.cluster;
      cluster.priority = request.priority;
      return MakeClusterExecutor(queue.get(), cluster);
    };
  }
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<BakeService> service, BakeService::Open(options));
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<GrpcServer> server,
                         GrpcServer::Start(words.server, service.get()));
  const bool open = !words.server.cert_file.empty();
  Log(LogLevel::kNote,
      "listening on " + words.server.listen + " (port " + std::to_string(server->port()) + "), " +
          (open ? "for clients with a certificate" : "for programs on this machine only, unencrypted"));
  if (common.json) PrintJson({{"port", server->port()}, {"store", options.store.string()}});
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
                 "MiB for hits kept between layers; 0: a quarter of the machine's")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1} << 32))
      ->type_name("MIB");
  app.add_option("--tls-cert", words->server.cert_file, "The service's certificate (PEM)")->type_name("FILE");
  app.add_option("--tls-key", words->server.key_file, "The key of that certificate (PEM)")->type_name("FILE");
  app.add_option("--tls-client-ca", words->server.client_ca_file,
                 "Certificate that clients' are signed with (PEM)")
      ->type_name("FILE");
  AddNatsWords(app, words->nats);
  AddReplicasWord(app, words->nats);
  AddLeaseWord(app, words->cluster);
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
