#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace glint {

/// What bakes and machines are like, in seconds. The defaults are of the order of what a small bake of the
/// teapot and a NATS server took (docs/scale.md); they are no averages over scenes or machines.
struct SimulatedWork {
  uint32_t vertices = 1'000'000;
  int layers = 4;
  double trace_seconds = 1.6e-3;   ///< of a vertex, once on every worker that computes it
  double gather_seconds = 0.8e-3;  ///< of a vertex and layer
  double unevenness = 4;           ///< the dearest vertices cost so many times what the cheapest do
  double open_seconds = 2;         ///< of a worker, once: the surface and its tree
  double turn_seconds = 0.05;      ///< of a worker, for each layer: its input
  double merge_seconds = 0;        ///< of the coordinator, between two layers
  int priority = 1;
};

struct SimulatedFleet {
  int workers = 1;              ///< of one thread
  double task_seconds = 0.012;  ///< fetching a message, publishing the chunk, acknowledging
  double look_seconds =
      3e-6;  ///< of the queue's server, for each line with messages that a worker is told of
  double lease_seconds = 30;
  double seconds_between_deaths = 0;  ///< of one worker, in the mean; 0: none dies
  double restart_seconds = 30;        ///< until one that died is back, with nothing in memory
  double stragglers = 0;              ///< part of the workers that ...
  double straggling = 3;              ///< ... take so many times as long
  uint64_t seed = 1;
};

struct SimulatedBake {
  double seconds = 0;  ///< until its last layer is merged; its rounds alone:
  double round_seconds = 0;
  double work_seconds = 0;    ///< of one processor that does everything once and never waits
  double traced_again = 0;    ///< part of what was traced: for the second time or more
  double worker_seconds = 0;  ///< that workers spent on it; of these:
  double again_seconds = 0;   ///< tracing what was traced before
  double turn_seconds = 0;    ///< opening the surface, reading layers
  double message_seconds = 0;
  size_t tasks = 0, computed_twice = 0, deaths = 0;

  /// Part of the workers' time that went into work that had to be done.
  double Efficiency(int workers) const { return work_seconds / (seconds * workers); }
  double RoundEfficiency(int workers) const { return work_seconds / (round_seconds * workers); }
};

/// Runs bakes on a fleet in simulated time: partition (coordinator/partition.h), dispatch
/// (coordinator/round_dispatcher.h) and the workers' choice of tasks (worker/line_chooser.h) are the real
/// ones; the queue, the store, the clock and the work are simulated. Deterministic.
/// @param until  simulated seconds after which it stops, finished or not
std::vector<SimulatedBake> SimulateCluster(const std::vector<SimulatedWork>& bakes,
                                           const SimulatedFleet& fleet, double until = 1e9);

}  // namespace glint
