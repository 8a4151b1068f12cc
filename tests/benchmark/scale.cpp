// Bakes on simulated fleets (tests/cluster/simulated_cluster.h): prints the table of docs/scale.md.
//
//   glint_benchmark_scale [--vertices 1000000] [--trace S] [--gather S] [--merge S] [--layers N]
//                         [--workers N] [--look S]
//
// Seconds are those of one processor: --trace and --gather of a vertex (and layer), --merge of a layer,
// --look of the queue's server, to tell a worker of one line.

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/cluster/simulated_cluster.h"

namespace glint {
namespace {

struct Case {
  const char* name;
  SimulatedFleet fleet;
};

void PrintRow(const SimulatedWork& work, SimulatedFleet fleet, int workers, double look) {
  fleet.workers = workers;
  fleet.look_seconds = look;
  const SimulatedBake bake = SimulateCluster({work}, fleet).front();
  const double all = bake.seconds * workers / 100;
  std::printf("| %d | %.0f | %.2f | %.1f | %.1f | %.1f | %.1f | %zu | %zu |\n", workers, bake.seconds,
              bake.Efficiency(workers), bake.again_seconds / all, bake.turn_seconds / all,
              bake.message_seconds / all, 100 - bake.worker_seconds / all, bake.tasks, bake.deaths);
}

int Main(int argc, char** argv) {
  SimulatedWork work;
  double look = SimulatedFleet().look_seconds;
  std::vector<int> fleets = {1, 16, 64, 128, 256, 512, 1000};
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string word = argv[i];
    const double value = std::atof(argv[i + 1]);
    if (word == "--vertices") work.vertices = static_cast<uint32_t>(value);
    if (word == "--layers") work.layers = static_cast<int>(value);
    if (word == "--trace") work.trace_seconds = value;
    if (word == "--gather") work.gather_seconds = value;
    if (word == "--merge") work.merge_seconds = value;
    if (word == "--look") look = value;
    if (word == "--workers") fleets = {static_cast<int>(value)};
  }
  const Case cases[] = {{"sound, alike", {}},
                        {"every worker dies once in an hour", {.seconds_between_deaths = 3600}},
                        {"a tenth of them three times as slow", {.stragglers = 0.1}}};
  for (const Case& c : cases) {
    std::printf(
        "\n%s\n\n| workers | seconds | efficiency | traced again %% | opening %% | messages %% | waiting %% "
        "| tasks | deaths "
        "|\n|---|---|---|---|---|---|---|---|---|\n",
        c.name);
    for (const int workers : fleets) PrintRow(work, c.fleet, workers, look);
  }
  return 0;
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) { return glint::Main(argc, argv); }
