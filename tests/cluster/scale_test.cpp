// How partition, dispatch and choice of tasks do on fleets that no test could start: docs/scale.md has the
// table, tests/benchmark/scale.cpp prints it.

#include <gtest/gtest.h>

#include "tests/cluster/simulated_cluster.h"

namespace glint {
namespace {

constexpr int kWorkers = 64;

/// Vertices that take ten times what those of the small bakes took that were measured: docs/scale.md.
SimulatedWork Heavy() { return {.trace_seconds = 16e-3, .gather_seconds = 8e-3}; }

SimulatedBake Simulate(const SimulatedWork& work, const SimulatedFleet& fleet) {
  return SimulateCluster({work}, fleet).front();
}

TEST(ScaleTest, KeepsSixtyFourWorkersBusy) {
  const SimulatedBake bake = Simulate(Heavy(), {.workers = kWorkers});
  EXPECT_GE(bake.Efficiency(kWorkers), 0.95);
  EXPECT_LT(bake.traced_again, 0.01);
  EXPECT_EQ(bake.computed_twice, 0u);
}

TEST(ScaleTest, TwoWorkersHardlyTraceWhatTheOtherTraced) {
  const SimulatedBake bake = Simulate({.vertices = 10'000, .open_seconds = 0.1}, {.workers = 2});
  EXPECT_LT(bake.traced_again, 0.12);
  EXPECT_GE(bake.RoundEfficiency(2), 0.85);
}

TEST(ScaleTest, KeepsTwoHundredAndFiftySixWorkersBusy) {
  const SimulatedBake bake = Simulate(Heavy(), {.workers = 256});
  EXPECT_GE(bake.Efficiency(256), 0.9);
  EXPECT_LT(bake.traced_again, 0.01);
}

TEST(ScaleTest, AThousandWorkersFinishSooner) {
  SimulatedWork work = Heavy();
  work.vertices = 200'000;
  const double few = Simulate(work, {.workers = kWorkers}).round_seconds;
  const double many = Simulate(work, {.workers = 1000}).round_seconds;
  EXPECT_LT(many, 0.3 * few);
}

TEST(ScaleTest, DeathsCostALeaseAndTheirTask) {
  const SimulatedFleet fleet{.workers = 64, .seconds_between_deaths = 600};
  const SimulatedBake bake = Simulate({}, fleet);
  EXPECT_GT(bake.deaths, 0u);
  EXPECT_EQ(bake.computed_twice, 0u) << "a finished task was computed again";
  // Every round may wait for a lease that ran out and the task of it.
  const double calm = Simulate({}, {.workers = 64}).round_seconds;
  EXPECT_LT(bake.round_seconds, 1.3 * calm + 4 * (fleet.lease_seconds + 20));
}

TEST(ScaleTest, StragglersTakeLessAndNotLonger) {
  const SimulatedFleet fleet{.workers = 64, .stragglers = 0.1, .straggling = 3};
  const double power = 0.9 + 0.1 / 3;  // of the fleet, relative to one without
  const double calm = Simulate({}, {.workers = 64}).round_seconds;
  EXPECT_LT(Simulate({}, fleet).round_seconds, 1.15 * calm / power);
}

TEST(ScaleTest, BakesShareTheWorkersByPriority) {
  SimulatedWork low = Heavy(), high = Heavy();
  high.priority = 3;
  const std::vector<SimulatedBake> bakes = SimulateCluster({low, high}, {.workers = 40}, 600);
  const double share = bakes[1].worker_seconds / (bakes[0].worker_seconds + bakes[1].worker_seconds);
  EXPECT_NEAR(share, 0.75, 0.08);
}

TEST(ScaleTest, IsTheSameEveryTime) {
  const SimulatedFleet fleet{.workers = 32, .seconds_between_deaths = 300, .stragglers = 0.1};
  const SimulatedWork work{.vertices = 50'000};
  EXPECT_EQ(Simulate(work, fleet).seconds, Simulate(work, fleet).seconds);
}

}  // namespace
}  // namespace glint
