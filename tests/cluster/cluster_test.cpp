// Real processes: workers, coordinators and a NATS server, killed at any moment. Afterwards the archive is
// the local bake's, and what was finished once was not computed again.

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <random>

#include "tests/cluster/cluster_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::StoredFiles;
using Clock = std::chrono::steady_clock;

TEST_F(ClusterTest, GivesTheArchiveOfTheLocalBake) {
  const auto first = StartWorker(), second = StartWorker();
  const ProcessResult baked = RunProcess(ClusterBakeCommand());
  ASSERT_EQ(baked.exit_code, 0) << baked.err << Text("workers.log");
  ExpectArchive();

  // A worker that is told to stop says what it did.
  for (const auto& worker : {first.get(), second.get()}) {
    worker->Signal(SIGTERM);
    EXPECT_EQ(worker->Wait(), 0) << Text("workers.log");
  }
  EXPECT_NE(Text("workers.log").find("\"computed\""), std::string::npos) << Text("workers.log");
}

TEST_F(ClusterTest, WaitsForAServerAndWorkersThatComeLater) {
  nats_.Kill();
  const auto bake = StartBake();
  Sleep(0.5);
  nats_.Start();
  Sleep(0.5);
  const auto worker = StartWorker();
  EXPECT_EQ(bake->Wait(), 0) << Text("bakes.log");
  ExpectArchive();
  EXPECT_NE(Text("bakes.log").find("does not answer"), std::string::npos) << Text("bakes.log");
}

TEST_F(ClusterTest, TakesATaskFromAWorkerThatHangs) {
  const auto bake = StartBake();
  const auto hanging = StartWorker();
  while (StoredFiles(store(), "tasks").empty()) Sleep(0.002);
  hanging->Signal(SIGSTOP);
  const auto worker = StartWorker();
  EXPECT_EQ(bake->Wait(), 0) << Text("bakes.log");
  ExpectArchive();
  // It wakes to a bake that is over.
  hanging->Signal(SIGCONT);
  hanging->Signal(SIGTERM);
  EXPECT_EQ(hanging->Wait(), 0) << Text("workers.log");
  ExpectArchive();
}

/// One task a layer, so that it is known which one a worker falls over.
class ClusterQuarantineTest : public ClusterTest {
 protected:
  ClusterQuarantineTest() { vertices_per_task_ = "100000"; }
};

TEST_F(ClusterQuarantineTest, GivesUpATaskThatKillsThreeTimes) {
  // Dies at its second file: the record of its first task. The worker itself writes but the report of that.
  const std::vector<std::string> falling = {"GLINT_CRASH_AT=before-write:2"};
  const auto bake = StartBake();
  EXPECT_EQ(StartWorker(falling)->Wait(), -SIGKILL);
  const auto worker = StartWorker(falling);
  EXPECT_EQ(bake->Wait(), 1) << Text("bakes.log");
  const std::string said = Text("bakes.log");
  for (const char* part : {"1 of 1 tasks of layer 0 were given up", "signal 9", "run-task --manifest"})
    EXPECT_NE(said.find(part), std::string::npos) << said;
  worker->Signal(SIGTERM);
  EXPECT_EQ(worker->Wait(), 0);

  // Mended, the same bake goes through.
  const auto sound = StartWorker();
  const ProcessResult again = RunProcess(ClusterBakeCommand());
  EXPECT_EQ(again.exit_code, 0) << again.err;
  ExpectArchive();
}

/// Kills at random moments.
class ClusterKillTest : public ClusterTest {
 protected:
  /// GLINT_CLUSTER_KILLS sets how many; by default few enough for every run of the tests.
  static int WantedKills() {
    const char* wanted = std::getenv("GLINT_CLUSTER_KILLS");
    return wanted ? std::max(1, std::atoi(wanted)) : 8;
  }

  void KillSomething() {
    switch (std::uniform_int_distribution<int>(0, 4)(random_)) {
      case 0:
      case 1: {
        auto& worker = workers_[random_() % workers_.size()];
        worker.reset();
        Sleep(Uniform(0, 0.1));
        worker = StartWorker();
        break;
      }
      case 2:
        bake_.reset();
        Sleep(Uniform(0, 0.1));
        bake_ = StartBake();
        break;
      case 3:
        nats_.Kill();
        Sleep(Uniform(0, 0.3));
        nats_.Start();
        break;
      default:
        nats_.KillAndForget();
        nats_.Start();
    }
    ++kills_;
  }
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  /// One bake from nothing, with kills until it ends.
  void BakeThroughKills(int most) {
    fs::remove_all(store());
    fs::create_directories(store());
    fs::remove(folder_ / "cluster.glint");
    finished_.clear();
    bake_ = StartBake();
    const Clock::time_point limit = Clock::now() + std::chrono::minutes(5);
    for (int kills = 0; bake_->Running(); CheckFinished()) {
      ASSERT_LT(Clock::now(), limit) << "does not get on\n" << Text("bakes.log") << Text("workers.log");
      Sleep(Uniform(0.02, 0.6));
      if (kills < most && bake_->Running()) {
        KillSomething();
        ++kills;
      }
    }
    EXPECT_EQ(bake_->Wait(), 0) << Text("bakes.log");
    CheckFinished();
    ExpectArchive();
    EXPECT_EQ(finished_.size(), tasks_);
  }

  std::mt19937 random_{20261123};
  std::vector<std::unique_ptr<BackgroundProcess>> workers_;
  std::unique_ptr<BackgroundProcess> bake_;
  int kills_ = 0;
};

TEST_F(ClusterKillTest, EndsWithTheSameArchive) {
  workers_.push_back(StartWorker());
  workers_.push_back(StartWorker());
  int bakes = 0;
  for (; kills_ < WantedKills() && !HasFailure(); ++bakes) BakeThroughKills(WantedKills() - kills_);
  std::cout << kills_ << " kills in " << bakes << " bakes\n";
}

}  // namespace
}  // namespace glint
