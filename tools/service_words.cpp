#include "tools/service_words.h"

namespace glint {
namespace {

constexpr char kGroup[] = "Cluster";

}  // namespace

void AddNatsWords(CLI::App& app, NatsOptions& nats) {
  app.add_option("--nats", nats.url, "NATS servers with JetStream, separated by commas; tls://... encrypts")
      ->envname("GLINT_NATS")
      ->capture_default_str()
      ->type_name("URL")
      ->group(kGroup);
  app.add_option("--nats-ca", nats.ca_file, "Certificate that NATS's is signed with (PEM)")
      ->check(CLI::ExistingFile)
      ->type_name("FILE")
      ->group(kGroup);
  app.add_option("--nats-cert", nats.cert_file, "This program's certificate for NATS (PEM)")
      ->check(CLI::ExistingFile)
      ->type_name("FILE")
      ->group(kGroup);
  app.add_option("--nats-key", nats.key_file, "The key of that certificate (PEM)")
      ->check(CLI::ExistingFile)
      ->type_name("FILE")
      ->group(kGroup);
}

void AddPriorityWord(CLI::App& app, ClusterOptions& cluster) {
  app.add_option("--priority", cluster.priority, "Share of the workers, relative to other bakes'")
      ->check(CLI::Range(1, kMaxPriority))
      ->capture_default_str()
      ->type_name("N")
      ->group(kGroup);
}

void AddLeaseWord(CLI::App& app, ClusterOptions& cluster) {
  app.add_option("--lease", cluster.lease_seconds,
                 "Seconds without a sign of life until a task goes to another worker")
      ->check(NumberRange(0.5, 3600))
      ->capture_default_str()
      ->type_name("S")
      ->group(kGroup);
}

void AddClientWords(CLI::App& app, ClientOptions& client) {
  const std::string group = "Service";
  app.add_option("--to", client.host, "Where the service is")
      ->envname("GLINT_SERVICE")
      ->capture_default_str()
      ->type_name("HOST:PORT")
      ->group(group);
  app.add_option("--tls-ca", client.ca_file, "Certificate that the service's is signed with (PEM)")
      ->type_name("FILE")
      ->group(group);
  app.add_option("--tls-cert", client.cert_file, "This client's certificate (PEM)")
      ->type_name("FILE")
      ->group(group);
  app.add_option("--tls-key", client.key_file, "The key of that certificate (PEM)")
      ->type_name("FILE")
      ->group(group);
  app.add_option("--token-file", client.token_file, "This client's token, as 'glint token' wrote it")
      ->envname("GLINT_TOKEN_FILE")
      ->type_name("FILE")
      ->group(group);
}

}  // namespace glint
