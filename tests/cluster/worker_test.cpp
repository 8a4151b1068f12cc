// The worker against a queue in memory.
#include "worker/worker.h"

#include <gtest/gtest.h>

#include <thread>

#include "common/base/log.h"
#include "common/round/quarantine.h"
#include "common/round/round_files.h"
#include "coordinator/manual_executor.h"
#include "tests/base/temp_folder.h"
#include "tests/cluster/fake_queue.h"
#include "tests/coordinator/bake_fixture.h"
#include "worker/execution_id.h"
#include "worker/isolated_task.h"
#include "worker/worker_metrics.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

/// A store with one bake, whose first round waits to be computed.
class WorkerTest : public testing::Test {
 protected:
  void SetUp() override {
    BakeOptions options = bake_fixture::SmallOptions();
    options.work_dir = folder_ / "store";
    options.vertices_per_task = 100;
    options.make_executor = MakeManualExecutor;
    const auto baked = BakeScene(bake_fixture::Generated("planes"), "scene", folder_ / "o.glint", options);
    ASSERT_EQ(baked.status().kind(), ErrorKind::kInterrupted) << baked.status().message();
    bake_folder_ = fs::directory_iterator(folder_ / "store")->path();
    const fs::path manifest = fs::directory_iterator(bake_folder_ / "rounds")->path();
    Result<RoundManifest> round = ReadManifest(manifest);
    ASSERT_TRUE(round.ok());
    round_ = std::move(round).value();
    manifest_ = *Digest::FromHex(manifest.stem().string());
    bake_ = {round_.Bake(), ExecutionId(), 1, 30};
    options_ = {folder_ / "store",
                folder_ / "no-such-program",
                2,
                uint64_t{1} << 26,
                3600,
                30,
                [](const std::string& task) { ADD_FAILURE() << task << " is stuck"; }};
  }
  void TearDown() override { ClearStop(); }

  void Publish(std::initializer_list<uint64_t> tasks) {
    std::vector<TaskMessage> messages;
    for (const uint64_t task : tasks) messages.push_back({manifest_, task});
    ASSERT_TRUE(queue_.Publish(bake_.bake, messages).ok());
  }
  /// Runs the worker until the queue is empty, or for a moment if nothing is to be taken.
  WorkerCounts Work(bool takes = true, WorkerMeter* meter = nullptr) {
    std::thread stopper([&] {
      for (int i = 0; i < (takes ? 20'000 : 200) && (!takes || queue_.Queued() > 0); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      RequestStop();
    });
    const WorkerCounts counts = RunWorker(&queue_, options_, meter);
    stopper.join();
    ClearStop();
    return counts;
  }
  bool HasResult(size_t task) const {
    const Result<ChunkStore> store = ChunkStore::Open(bake_folder_);
    return store->FindResult(round_.Task(task).key).has_value();
  }

  const TempFolder folder_;
  fs::path bake_folder_;
  RoundManifest round_;
  Digest manifest_;
  QueuedBake bake_;
  WorkerOptions options_;
  FakeQueue queue_;
};

TEST_F(WorkerTest, ComputesWhatIsMissingAndFindsTheRest) {
  ASSERT_TRUE(queue_.Open(bake_).ok());
  Publish({0, 1, 2});
  EXPECT_EQ(Work().computed, 3u);
  Publish({2, 1, 3});
  const WorkerCounts counts = Work();
  EXPECT_EQ(counts.computed, 1u);
  EXPECT_EQ(counts.found, 2u);
  for (const size_t task : {0, 1, 2, 3}) EXPECT_TRUE(HasResult(task)) << task;
  EXPECT_FALSE(HasResult(4));
  EXPECT_EQ(queue_.done, 6u);
}

TEST_F(WorkerTest, CountsForWhoeverWatches) {
  ASSERT_TRUE(queue_.Open(bake_).ok());
  Publish({0, 1});
  WorkerMeter meter;
  Work(true, &meter);
  EXPECT_EQ(meter.computed, 2u);
  EXPECT_EQ(meter.redelivered, 0u);
  EXPECT_EQ(meter.busy, 0);
  EXPECT_GT(meter.rays, 0u);
  EXPECT_GT(meter.round_seconds, 0);
  EXPECT_GT(meter.gather_seconds, 0);
  EXPECT_GT(meter.publish_seconds, 0);
  const std::string text = ToPrometheus(WorkerMetrics(meter, 2));
  for (const std::string& line : {std::string("glint_worker_tasks_total{outcome=\"computed\"} 2\n"),
                                  "glint_worker_rays_total " + std::to_string(meter.rays) + "\n",
                                  std::string("glint_worker_own_threads{state=\"all\"} 2\n")})
    EXPECT_NE(text.find(line), std::string::npos) << line << text;
}

TEST_F(WorkerTest, TakesNoTaskThatItCannotCompute) {
  bake_.execution = "glint 9.9.9 for another processor";
  ASSERT_TRUE(queue_.Open(bake_).ok());
  Publish({0, 1});
  testing::internal::CaptureStderr();
  const WorkerCounts counts = Work(false);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(counts.computed + counts.returned, 0u);
  EXPECT_EQ(queue_.Queued(), 2u);
  EXPECT_NE(said.find("takes no task of bake " + bake_.bake.Hex()), std::string::npos) << said;
  EXPECT_NE(said.find("glint 9.9.9"), std::string::npos) << said;
}

TEST_F(WorkerTest, TakesNoTaskOfABakeThatIsNotInItsStore) {
  bake_.bake.bytes[0] ^= 1;
  ASSERT_TRUE(queue_.Open(bake_).ok());
  Publish({0});
  EXPECT_EQ(Work(false).computed, 0u);
  EXPECT_EQ(queue_.Queued(), 1u);
  EXPECT_FALSE(fs::exists(folder_ / "store" / bake_.bake.Hex()));
}

TEST_F(WorkerTest, DropsMessagesOfRoundsThatAreNot) {
  ASSERT_TRUE(queue_.Open(bake_).ok());
  const TaskMessage strangers[] = {
      {Sha256({}), 0}, {manifest_, round_.blocks.size()}, {manifest_, ~uint64_t{0}}};
  ASSERT_TRUE(queue_.Publish(bake_.bake, strangers).ok());
  const WorkerCounts counts = Work();
  EXPECT_EQ(counts.computed + counts.found + counts.returned + counts.given_up, 0u);
  EXPECT_EQ(queue_.given_up, 3u);
}

/// A shell script in the program's place.
class WorkerProgramTest : public WorkerTest {
 protected:
  void Install(const std::string& script) {
    options_.program = folder_ / "program";
    const std::string text = "#!/bin/sh\n" + script + "\n";
    ASSERT_TRUE(PublishFile(options_.program, std::as_bytes(std::span(text))).ok());
    fs::permissions(options_.program, fs::perms::owner_all);
    // As after a worker's death: the message comes for the second time.
    ASSERT_TRUE(queue_.Open(bake_).ok());
    Publish({1});
    queue_.Take(bake_.bake)->Return(0);
  }
  std::optional<QuarantineRecord> Record() const { return ReadQuarantine(bake_folder_, round_.Task(1).key); }
};

TEST_F(WorkerProgramTest, RunsWhatComesBackApartAndGivesItUpTheThirdTime) {
  Install("echo \"about to fall: $*\" >&2; kill -SEGV $$");
  WorkerMeter meter;
  const WorkerCounts counts = Work(true, &meter);
  EXPECT_EQ(meter.redelivered, 2u);
  EXPECT_EQ(counts.returned, 1u);
  EXPECT_EQ(counts.given_up, 1u);
  const std::optional<QuarantineRecord> record = Record();
  ASSERT_TRUE(record.has_value());
  EXPECT_EQ(record->task, 1u);
  EXPECT_EQ(record->deliveries, 3);
  EXPECT_NE(record->reason.find("signal 11"), std::string::npos) << record->reason;
  EXPECT_NE(record->error_output.find("about to fall: run-task"), std::string::npos) << record->error_output;
  EXPECT_NE(record->command.find(" run-task --manifest " + ManifestPath(bake_folder_, manifest_).string()),
            std::string::npos)
      << record->command;
}

TEST_F(WorkerProgramTest, KillsWhatDoesNotEnd) {
  options_.deadline_seconds = 0.3;
  Install("exec sleep 1000");
  EXPECT_EQ(Work().given_up, 1u);
  ASSERT_TRUE(Record().has_value());
  EXPECT_NE(Record()->reason.find("deadline"), std::string::npos) << Record()->reason;
}

TEST_F(WorkerProgramTest, NeverGivesUpForTheEnvironmentsSake) {
  // Exit code 6: the file system failed. It is well again the fourth time.
  Install("n=$(cat " + (folder_ / "count").string() + " 2>/dev/null || echo 0); echo $((n + 1)) > " +
          (folder_ / "count").string() + "; [ $n -ge 3 ] && exit 0; exit 6");
  const WorkerCounts counts = Work();
  EXPECT_EQ(counts.returned, 3u);
  EXPECT_EQ(counts.computed, 1u);
  EXPECT_EQ(counts.given_up, 0u);
  EXPECT_FALSE(Record().has_value());
}

TEST(ShellLineTest, QuotesWhatAShellWouldTakeApart) {
  EXPECT_EQ(ShellLine({"/usr/bin/glint", "--store", "/a b/it's", ""}),
            "/usr/bin/glint --store '/a b/it'\\''s' ''");
}

}  // namespace
}  // namespace glint
