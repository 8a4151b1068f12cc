#include <cstdlib>
#include <filesystem>
#include <memory>
#include <system_error>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/memory.h"
#include "common/base/parallel.h"
#include "common/queue/nats_queue.h"
#include "tools/commands.h"
#include "tools/monitor_words.h"
#include "tools/service_words.h"
#include "worker/execution_id.h"
#include "worker/worker.h"
#include "worker/worker_metrics.h"

namespace glint {
namespace {

struct WorkerWords {
  WorkerOptions options;
  NatsOptions nats;
  MonitorWords monitor;
  uint64_t memory_mib = 0;
};

/// The tasks that this process has come again, to others; whoever started it starts it again.
void EndProcess(const std::string& task) {
  Log(LogLevel::kError, task + " is past its deadline; this worker ends, its tasks go to others");
  std::_Exit(static_cast<int>(ErrorKind::kInternal));
}

/// What the worker shows, and what it cannot work without.
Monitored Watched(const WorkerMeter& meter, const WorkerOptions& options, NatsQueue* queue) {
  return {[&meter, threads = options.threads] { return WorkerMetrics(meter, threads); },
          {{"store", [store = options.store] { return CheckWritable(store); }},
           {"queue", [queue] { return queue->CheckReachable(); }}}};
}

Status RunWorkerCommand(const WorkerWords& words, const CommonWords& common) {
  SetLogFormat(words.monitor.log_format);
  WorkerOptions options = words.options;
  options.threads = ResolveThreadCount(common.threads);
  options.memory_bytes = words.memory_mib ? words.memory_mib << 20 : UsableMemory() / 4;
  options.on_stuck = EndProcess;
  std::error_code error;
  options.program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return IoError("/proc/self/exe: cannot find this program: " + error.message());

  NatsOptions nats = words.nats;
  nats.inbox = kWorkerInbox;
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<NatsQueue> queue, NatsQueue::Connect(nats));
  WorkerMeter meter;
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<MonitorServer> monitor,
                         StartMonitor(words.monitor, Watched(meter, options, queue.get())));
  Log(LogLevel::kNote, "worker of " + std::to_string(options.threads) + " threads on " +
                           options.store.string() + " for bakes of '" + ExecutionId() + "'; may use " +
                           std::to_string(UsableMemory() >> 20) + " MiB of memory, " +
                           std::to_string(options.memory_bytes >> 20) +
                           " of them for hits kept between layers");
  const WorkerCounts counts = RunWorker(queue.get(), options, &meter);
  Log(LogLevel::kNote, "worker ends: " + std::to_string(counts.computed) + " tasks computed, " +
                           std::to_string(counts.found) + " found done, " + std::to_string(counts.returned) +
                           " returned, " + std::to_string(counts.given_up) + " given up");
  if (common.json) {
    PrintJson({{"computed", counts.computed},
               {"found", counts.found},
               {"returned", counts.returned},
               {"given_up", counts.given_up}});
  }
  return {};
}

}  // namespace

Command AddWorkerCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("worker", "Compute tasks of the cluster's bakes until told to stop");
  const auto words = std::make_shared<WorkerWords>();
  WorkerOptions& options = words->options;
  app.add_option("--store", options.store, "Folder of all bakes, shared with those who submit them")
      ->required()
      ->check(CLI::ExistingDirectory)
      ->type_name("FOLDER");
  app.add_option("--memory", words->memory_mib,
                 "MiB for hits kept between layers; 0: a quarter of what it may use")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1} << 32))
      ->type_name("MIB");
  app.add_option("--deadline", options.deadline_seconds, "Seconds after which a task counts as hung")
      ->check(NumberRange(1, 1e6))
      ->capture_default_str()
      ->type_name("S");
  app.add_option("--share", options.share_seconds, "Seconds with one bake while others have tasks too")
      ->check(NumberRange(0.1, 1e6))
      ->capture_default_str()
      ->type_name("S");
  AddNatsWords(app, words->nats);
  AddMonitorWords(app, words->monitor);
  AddCommonWords(app, common);
  app.footer(
      "Workers may come and go at any time. Ctrl-C or SIGTERM: finishes the tasks at work, takes no new "
      "one.\n"
      "\n"
      "Example:\n"
      "  glint worker --store /shared/bakes --nats nats://queue:4222 --threads 8");
  return [words, &common] { return RunWorkerCommand(*words, common); };
}

}  // namespace glint
