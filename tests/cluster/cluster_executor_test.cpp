// The cluster executor against a queue in memory, whose workers run whenever the executor waits: every fault
// at a chosen moment, without sockets and without sleeps.
#include "coordinator/cluster_executor.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <set>
#include <utility>

#include "common/round/quarantine.h"
#include "common/round/round_files.h"
#include "tests/base/temp_folder.h"
#include "tests/cluster/fake_queue.h"
#include "tests/coordinator/bake_fixture.h"
#include "worker/bake_runner.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;
using bake_fixture::SmallOptions;

class ClusterExecutorTest : public testing::Test {
 protected:
  void SetUp() override {
    options_.vertices_per_task = 100;
    const Result<BakeReport> local = BakeScene(scene_, "scene", folder_ / "local.glint", options_);
    ASSERT_TRUE(local.ok()) << local.status().message();
    expected_ = BytesOf(folder_ / "local.glint");
    tasks_ = local->tasks;
    options_.work_dir = folder_ / "store";
    options_.keep_work = true;
  }

  Result<BakeReport> Bake() {
    cluster_.wait = [this](double) {
      ASSERT_LT(++waits_, 5000) << "does not get on";
      on_wait_();
    };
    options_.make_executor = MakeClusterExecutor(&queue_, cluster_);
    return BakeScene(scene_, "scene", folder_ / "cluster.glint", options_);
  }
  void ExpectArchive(const Result<BakeReport>& baked) {
    ASSERT_TRUE(baked.ok()) << baked.status().message();
    EXPECT_TRUE(BytesOf(folder_ / "cluster.glint") == expected_);
    EXPECT_EQ(baked->tasks, tasks_);
    EXPECT_EQ(computed_.size(), tasks_);
    EXPECT_EQ(computations_, tasks_) << "a finished task was computed again";
    EXPECT_EQ(queue_.bakes(), 0u);
  }

  fs::path BakeFolder(const Digest& bake) const { return folder_ / "store" / bake.Hex(); }
  /// What a worker does with up to `most` messages.
  void Work(size_t most) {
    for (size_t i = 0; i < most; ++i) {
      const std::optional<Digest> bake = queue_.AnyBake();
      const std::unique_ptr<TaskLease> lease = bake ? queue_.Take(*bake) : nullptr;
      if (!lease) return;
      Compute(*bake, lease->message());
      lease->Done();
    }
  }
  void Compute(const Digest& bake, const TaskMessage& task) {
    if (!runner_) {
      Result<BakeRunner> opened = BakeRunner::Open(BakeFolder(bake), 1, uint64_t{1} << 26);
      ASSERT_TRUE(opened.ok());
      runner_ = std::make_unique<BakeRunner>(std::move(opened).value());
    }
    const Result<RoundManifest> round = ReadManifest(BakeFolder(bake), task.manifest);
    ASSERT_TRUE(round.ok()) << round.status().message();
    const Result<bool> was_there = runner_->Run(*round, task.index);
    ASSERT_TRUE(was_there.ok()) << was_there.status().message();
    if (*was_there) return;
    ++computations_;
    computed_.insert(round->Task(task.index).key);
  }

  const TempFolder folder_;
  const Scene scene_ = bake_fixture::Generated("planes");
  BakeOptions options_ = SmallOptions();
  ClusterOptions cluster_;
  std::vector<std::byte> expected_;
  size_t tasks_ = 0, computations_ = 0;
  int waits_ = 0;
  FakeQueue queue_;
  std::unique_ptr<BakeRunner> runner_;
  std::set<Digest> computed_;
  std::function<void()> on_wait_ = [this] { Work(2); };
};

TEST_F(ClusterExecutorTest, GivesTheArchiveOfTheLocalBake) {
  ExpectArchive(Bake());
  EXPECT_EQ(queue_.published, tasks_) << "a queue that loses nothing is told once";
  EXPECT_EQ(queue_.opened, 1u);
}

TEST_F(ClusterExecutorTest, TellsAQueueThatForgotEverythingAgain) {
  on_wait_ = [this] {
    Work(1);
    if (waits_ % 3 == 0) queue_.Lose();
  };
  ExpectArchive(Bake());
  EXPECT_GT(queue_.opened, 3u);
}

TEST_F(ClusterExecutorTest, BelievesTheStoreAndNotTheQueue) {
  // Every other message is acknowledged without a result.
  on_wait_ = [this] {
    Work(1);
    const std::optional<Digest> bake = queue_.AnyBake();
    const std::unique_ptr<TaskLease> lost = bake ? queue_.Take(*bake) : nullptr;
    if (lost) lost->Done();
  };
  ExpectArchive(Bake());
  EXPECT_GT(queue_.published, tasks_);
}

TEST_F(ClusterExecutorTest, FindsWhatComesTwiceOrTooLateDone) {
  std::map<std::pair<Digest, uint64_t>, TaskMessage> seen;
  on_wait_ = [&] {
    const std::optional<Digest> bake = queue_.AnyBake();
    const std::unique_ptr<TaskLease> lease = bake ? queue_.Take(*bake) : nullptr;
    if (!lease) return;
    const TaskMessage task = lease->message();
    Compute(*bake, task);
    lease->Done();
    const bool first = seen.emplace(std::pair(task.manifest, task.index), task).second;
    // Each comes once more at once; and the first task of all in every layer, when its round is long over.
    const Status again = first ? queue_.Publish(*bake, std::array{task, seen.begin()->second}) : Status();
    ASSERT_TRUE(again.ok());
  };
  ExpectArchive(Bake());
  EXPECT_GE(queue_.published, 3 * tasks_);
}

TEST_F(ClusterExecutorTest, WaitsForAQueueThatIsAway) {
  queue_.SetDown(true);
  on_wait_ = [this] {
    queue_.SetDown(waits_ % 7 < 5);
    if (waits_ % 7 >= 5) Work(3);
  };
  ExpectArchive(Bake());
}

TEST_F(ClusterExecutorTest, KeepsTheQueueWithinItsBound) {
  options_.vertices_per_task = 20;
  cluster_.max_queued = 4;
  const Result<BakeReport> baked = Bake();
  ASSERT_TRUE(baked.ok()) << baked.status().message();
  EXPECT_TRUE(BytesOf(folder_ / "cluster.glint") == expected_);
  EXPECT_GT(baked->tasks, 12u);
  EXPECT_LE(queue_.most_queued, 4u);
  EXPECT_EQ(queue_.published, baked->tasks);
}

TEST_F(ClusterExecutorTest, GoesOnWithWhatAnEarlierCoordinatorLeft) {
  queue_.IgnoreClosing();
  options_.stop = [this] { return waits_ >= 2; };
  EXPECT_EQ(Bake().status().kind(), ErrorKind::kInterrupted);
  const size_t published = queue_.published, queued = queue_.Queued();
  ASSERT_GT(queued, 0u);
  const size_t finished = computations_;
  ASSERT_GT(finished, 0u);

  options_.stop = [] { return false; };
  const Result<BakeReport> baked = Bake();
  ASSERT_TRUE(baked.ok()) << baked.status().message();
  EXPECT_TRUE(BytesOf(folder_ / "cluster.glint") == expected_);
  EXPECT_EQ(computations_, tasks_);
  EXPECT_EQ(baked->tasks_reused, finished);
  EXPECT_EQ(queue_.published, tasks_) << "what was still queued was published again (" << published << ")";
}

TEST_F(ClusterExecutorTest, ClosesTheQueueWhenItIsStopped) {
  options_.stop = [this] { return waits_ >= 2; };
  EXPECT_EQ(Bake().status().kind(), ErrorKind::kInterrupted);
  EXPECT_EQ(queue_.bakes(), 0u);
  EXPECT_FALSE(fs::exists(folder_ / "cluster.glint"));
}

TEST_F(ClusterExecutorTest, NamesTasksThatWereGivenUpAfterDoingTheRest) {
  Digest bad;
  size_t tasks = 0;
  on_wait_ = [&] {
    const std::optional<Digest> bake = queue_.AnyBake();
    const std::unique_ptr<TaskLease> lease = bake ? queue_.Take(*bake) : nullptr;
    if (!lease) return;
    if (lease->message().index != 1) {
      Compute(*bake, lease->message());
      lease->Done();
      return;
    }
    const Result<RoundManifest> round = ReadManifest(BakeFolder(*bake), lease->message().manifest);
    ASSERT_TRUE(round.ok());
    bad = round->Task(1).key;
    tasks = round->blocks.size();
    const Status written =
        WriteQuarantine(BakeFolder(*bake), bad, {1, 0, 3, "ended by signal 11", "oh", "glint x"});
    ASSERT_TRUE(written.ok()) << written.message();
    lease->GiveUp();
  };
  const Result<BakeReport> baked = Bake();
  ASSERT_EQ(baked.status().kind(), ErrorKind::kInternal);
  const std::string count = "1 of " + std::to_string(tasks) + " tasks of layer 0";
  for (const std::string& part : {count, std::string("task 1: ended by signal 11"), std::string("glint x")})
    EXPECT_NE(baked.status().message().find(part), std::string::npos) << baked.status().message();
  EXPECT_EQ(computations_, tasks - 1) << "the others were to be done first";
  EXPECT_EQ(queue_.bakes(), 0u);

  on_wait_ = [this] { Work(2); };
  ExpectArchive(Bake());
}

}  // namespace
}  // namespace glint
