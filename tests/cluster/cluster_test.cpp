// Real processes: workers, coordinators and a NATS server, killed at any moment. Afterwards the archive is
// the local bake's, and what was finished once was not computed again.

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <map>
#include <random>
#include <thread>

#include "common/base/files.h"
#include "tests/base/temp_folder.h"
#include "tests/cluster/nats_server.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;
using bake_fixture::StoredFiles;
using Clock = std::chrono::steady_clock;

void Sleep(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

class ClusterTest : public testing::Test {
 protected:
  void SetUp() override {
    const Status saved = SaveScene(bake_fixture::Generated("planes", 600), scene());
    ASSERT_TRUE(saved.ok()) << saved.message();
    const ProcessResult local = RunProcess(BakeCommand("local", {"--keep-work"}));
    ASSERT_EQ(local.exit_code, 0) << local.err;
    expected_ = BytesOf(folder_ / "local.glint");
    tasks_ = StoredFiles(folder_ / "local.glint.work", "tasks").size();
    fs::create_directories(store());
  }

  std::vector<std::string> BakeCommand(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> command = {GLINT_PROGRAM,
                                        "bake",
                                        scene().string(),
                                        "-o",
                                        (folder_ / (out + ".glint")).string(),
                                        "--directions",
                                        "162",
                                        "--layers",
                                        "2",
                                        "--layer-tolerance",
                                        "0",
                                        "--max-rays",
                                        "512",
                                        "--vertices-per-task",
                                        vertices_per_task_,
                                        "--threads",
                                        "1"};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }
  std::vector<std::string> ClusterBakeCommand() const {
    return BakeCommand("cluster", {"--executor", "cluster", "--work-dir", store().string(), "--nats",
                                   nats_.url(), "--lease", "1", "--keep-work"});
  }
  std::unique_ptr<BackgroundProcess> StartWorker(const std::vector<std::string>& environment = {}) const {
    return std::make_unique<BackgroundProcess>(
        std::vector<std::string>{GLINT_PROGRAM, "worker", "--store", store().string(), "--nats", nats_.url(),
                                 "--threads", "1", "--json"},
        folder_ / "workers.log", environment);
  }
  std::unique_ptr<BackgroundProcess> StartBake() const {
    return std::make_unique<BackgroundProcess>(ClusterBakeCommand(), folder_ / "bakes.log");
  }
  void ExpectArchive() const {
    EXPECT_TRUE(BytesOf(folder_ / "cluster.glint") == expected_);
    EXPECT_EQ(StoredFiles(store(), "tasks").size(), tasks_);
  }
  std::string Text(const std::string& file) const {
    const std::vector<std::byte> bytes = BytesOf(folder_ / file);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  fs::path scene() const { return folder_ / "scene.glb"; }
  fs::path store() const { return folder_ / "store"; }

  const TempFolder folder_;
  std::string vertices_per_task_ = "40";
  NatsServer nats_{folder_ / "nats"};
  std::vector<std::byte> expected_;
  size_t tasks_ = 0;
};

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

  /// Notes which results are there, and that those noted before are the same files still.
  void CheckFinished() {
    for (const fs::path& record : StoredFiles(store(), "tasks")) {
      struct stat info = {};
      if (stat(record.c_str(), &info) != 0) continue;
      const ino_t known = finished_.emplace(record, info.st_ino).first->second;
      EXPECT_EQ(known, info.st_ino) << record << " was computed again";
    }
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
  std::map<fs::path, ino_t> finished_;
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
