// What workers behind a queue cost, on this machine with processes and a NATS server of its own:
//   overhead    a bake by N workers of one thread against the same bake by N threads of one process: wall and
//               processor seconds of all processes together, best of `--repeats`
//   costs       processor seconds of a vertex in each layer, and of the coordinator between layers: what
//               glint_benchmark_scale is told
//   tasks       how many of next to no work go through in a second
//   kills       seconds from `kill -9` until the next task is finished: of the worker (started again at once;
//               its task comes again after the lease), of the coordinator, and of the NATS server
//
//   glint_benchmark_cluster [--scene teapot] [--vertices 3000] [--layers 3] [--workers 2] [--repeats 3]
//                           [--only overhead|tasks|kills]

#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "common/round/manifest.h"
#include "common/round/round_files.h"
#include "common/scene/generate.h"
#include "common/scene/load.h"
#include "common/store/store.h"
#include "tests/base/process.h"
#include "tests/base/temp_folder.h"
#include "tests/cluster/nats_server.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string scene = "teapot", only;
  uint32_t vertices = 3000;
  int layers = 3, workers = 2, repeats = 3;
};

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
void Sleep(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

/// Of children that have ended.
double ChildSeconds() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

[[noreturn]] void Fail(const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  std::exit(1);
}

/// A scene, a store, a server, and the processes on them.
class Bench {
 public:
  Bench(const Arguments& args, uint32_t vertices, std::vector<std::string> words)
      : args_(args), words_(std::move(words)) {
    Result<Scene> scene = GenerateScene(args.scene, {vertices, 0});
    if (!scene.ok() || !SaveScene(*scene, folder_ / "scene.glb").ok()) Fail("cannot make the scene");
    fs::create_directories(store());
  }

  std::vector<std::string> BakeCommand(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> command = {
        GLINT_PROGRAM, "bake", (folder_ / "scene.glb").string(), "-o", (folder_ / out).string(), "--quiet"};
    command.insert(command.end(), words_.begin(), words_.end());
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }
  std::vector<std::string> ClusterCommand() const {
    return BakeCommand("cluster.glint",
                       {"--executor", "cluster", "--work-dir", store().string(), "--nats", nats_.url(),
                        "--lease", "2", "--keep-work", "--threads", std::to_string(args_.workers)});
  }
  std::unique_ptr<BackgroundProcess> StartWorker() const {
    return std::make_unique<BackgroundProcess>(
        std::vector<std::string>{GLINT_PROGRAM, "worker", "--store", store().string(), "--nats", nats_.url(),
                                 "--threads", "1", "--quiet"},
        folder_ / "workers.log");
  }
  std::unique_ptr<BackgroundProcess> StartBake() const {
    return std::make_unique<BackgroundProcess>(ClusterCommand(), folder_ / "bake.log");
  }
  void Clear() const {
    fs::remove_all(store());
    fs::create_directories(store());
  }
  size_t Finished() const {
    size_t count = 0;
    std::error_code error;
    for (fs::recursive_directory_iterator i(store(), error), end; !error && i != end; i.increment(error))
      count += i->path().parent_path().parent_path().filename() == "tasks";
    return count;
  }

  fs::path store() const { return folder_ / "store"; }
  const TempFolder& folder() const { return folder_; }
  NatsServer& nats() { return nats_; }

 private:
  const Arguments& args_;
  const std::vector<std::string> words_;
  const TempFolder folder_;
  NatsServer nats_{folder_ / "nats"};
};

struct Cost {
  double wall = 1e300, cpu = 1e300;
};

/// Runs `what`, whose processes have ended when it returns.
void Measure(const std::function<void()>& what, Cost* best) {
  const double cpu = ChildSeconds(), wall = Now();
  what();
  best->wall = std::min(best->wall, Now() - wall);
  best->cpu = std::min(best->cpu, ChildSeconds() - cpu);
}

void Run(const std::vector<std::string>& command) {
  const ProcessResult result = RunProcess(command);
  if (result.exit_code != 0) Fail(result.err);
}

/// Processor seconds of a vertex in each layer, from the records of a bake that was kept.
void PrintCosts(const Bench& bench) {
  const fs::path bake = fs::directory_iterator(bench.store())->path();
  const Result<ChunkStore> store = ChunkStore::Open(bake);
  std::map<int, std::pair<double, uint64_t>> layers;
  for (const auto& plan : fs::directory_iterator(bake / "plans")) {
    const Result<RoundManifest> round = ReadManifest(plan.path());
    if (!store.ok() || !round.ok()) Fail("cannot read the bake's folder");
    auto& [seconds, vertices] = layers[round->layer];
    for (size_t i = 0; i < round->blocks.size(); ++i) {
      seconds += store->FindNote(round->Task(i).key).value_or(TaskNote()).seconds;
      vertices += round->blocks[i].vertices;
    }
  }
  for (const auto& [layer, sum] : layers)
    std::printf("layer %d: %.3g ms of a processor a vertex\n", layer,
                1e3 * sum.first / static_cast<double>(sum.second));
  std::ifstream report(bench.folder() / "cluster.glint.json");
  for (const auto& [stage, seconds] : nlohmann::json::parse(report)["seconds_by_stage"].items())
    if (stage.starts_with("merge")) std::printf("%s: %.3f s\n", stage.c_str(), seconds.get<double>());
}

void MeasureOverhead(const Arguments& args) {
  Bench bench(args, args.vertices, {"--layers", std::to_string(args.layers), "--layer-tolerance", "0"});
  Cost local, cluster;
  for (int i = 0; i < args.repeats; ++i) {
    Measure(
        [&] {
          Run(bench.BakeCommand("local.glint", {"--threads", std::to_string(args.workers)}));
        },
        &local);
    bench.Clear();
    Cost waiting;
    Measure(
        [&] {
          std::vector<std::unique_ptr<BackgroundProcess>> workers;
          for (int w = 0; w < args.workers; ++w) workers.push_back(bench.StartWorker());
          Sleep(1);  // they are long-lived: the bake does not start them
          const double begin = Now();
          Run(bench.ClusterCommand());
          cluster.wall = std::min(cluster.wall, Now() - begin);
          for (const auto& worker : workers) worker->Signal(SIGTERM);
          for (const auto& worker : workers) worker->Wait();
        },
        &waiting);
    cluster.cpu = std::min(cluster.cpu, waiting.cpu);
  }
  std::printf("%s, %u vertices, %d layers, %d threads or workers of one\n", args.scene.c_str(), args.vertices,
              args.layers + 1, args.workers);
  std::printf("local:   %7.2f s wall, %7.2f s of processors\n", local.wall, local.cpu);
  std::printf("workers: %7.2f s wall, %7.2f s of processors\n", cluster.wall, cluster.cpu);
  std::printf("overhead: %+.1f %% wall, %+.1f %% of processors\n", 100 * (cluster.wall / local.wall - 1),
              100 * (cluster.cpu / local.cpu - 1));
  PrintCosts(bench);
}

void MeasureTasks(const Arguments& args) {
  Bench bench(args, 3000,
              {"--layers", "0", "--directions", "12", "--max-rays", "256", "--vertices-per-task", "1",
               "--estimate", "0"});
  const auto workers = [&] {
    std::vector<std::unique_ptr<BackgroundProcess>> started;
    for (int w = 0; w < args.workers; ++w) started.push_back(bench.StartWorker());
    return started;
  }();
  const auto bake = bench.StartBake();
  while (bench.Finished() < 100 && bake->Running()) Sleep(0.01);
  const double begin = Now();
  const size_t first = bench.Finished();
  size_t last = first;
  while (last < 2500 && bake->Running()) {
    Sleep(0.2);
    last = bench.Finished();
  }
  std::printf("tasks a second, %d workers: %.0f\n", args.workers,
              static_cast<double>(last - first) / (Now() - begin));
}

/// Seconds from `kill` until another task is finished; 0: the bake ended before.
double UntilNextTask(const Bench& bench, BackgroundProcess* bake, const std::function<void()>& kill) {
  const size_t before = bench.Finished();
  while (bench.Finished() < before + 2 && bake->Running()) Sleep(0.001);
  const double begin = Now();
  kill();
  const size_t then = bench.Finished();
  while (bench.Finished() == then) {
    if (Now() - begin > 60) return 0;
    Sleep(0.001);
  }
  return Now() - begin;
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void MeasureKills(const Arguments& args) {
  Bench bench(args, args.vertices, {"--layers", "1", "--layer-tolerance", "0", "--vertices-per-task", "30"});
  std::vector<double> worker_seconds, coordinator_seconds, server_seconds;
  for (int i = 0; i < args.repeats; ++i) {
    bench.Clear();
    auto bake = bench.StartBake();
    auto worker = bench.StartWorker();
    worker_seconds.push_back(UntilNextTask(bench, bake.get(), [&] {
      worker.reset();
      worker = bench.StartWorker();
    }));
    server_seconds.push_back(UntilNextTask(bench, bake.get(), [&] {
      bench.nats().Kill();
      bench.nats().Start();
    }));
    coordinator_seconds.push_back(UntilNextTask(bench, bake.get(), [&] {
      bake.reset();
      bake = bench.StartBake();
    }));
  }
  std::printf(
      "seconds from kill to the next finished task: worker %.2f, NATS server %.2f, coordinator %.2f\n",
      Median(worker_seconds), Median(server_seconds), Median(coordinator_seconds));
}

int Main(int argc, char** argv) {
  Arguments args;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string word = argv[i], value = argv[i + 1];
    if (word == "--scene") args.scene = value;
    if (word == "--only") args.only = value;
    if (word == "--vertices") args.vertices = static_cast<uint32_t>(std::stoul(value));
    if (word == "--layers") args.layers = std::stoi(value);
    if (word == "--workers") args.workers = std::stoi(value);
    if (word == "--repeats") args.repeats = std::stoi(value);
  }
  if (args.only.empty() || args.only == "overhead") MeasureOverhead(args);
  if (args.only.empty() || args.only == "tasks") MeasureTasks(args);
  if (args.only.empty() || args.only == "kills") MeasureKills(args);
  return 0;
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) { return glint::Main(argc, argv); }
