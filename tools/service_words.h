#pragma once

#include "common/queue/nats_queue.h"
#include "coordinator/cluster_executor.h"
#include "tools/client.h"
#include "tools/options.h"

namespace glint {

/// Where the queue is and who this program is to it.
void AddNatsWords(CLI::App& app, NatsOptions& nats);
/// How many of its servers hold each message; for those that publish.
void AddReplicasWord(CLI::App& app, NatsOptions& nats);
/// How a bake shares the workers.
void AddPriorityWord(CLI::App& app, ClusterOptions& cluster);
void AddLeaseWord(CLI::App& app, ClusterOptions& cluster);
/// Where the service is and who this program is to it.
void AddClientWords(CLI::App& app, ClientOptions& client);

}  // namespace glint
