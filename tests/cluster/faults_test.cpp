// Disks, queues and machines that fail in other ways than by dying. Afterwards the archive is the local
// bake's, and what was finished once was not computed again.

#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/mount.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <iostream>

#include "tests/cluster/cluster_fixture.h"
#include "tests/cluster/nats_cluster.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::StoredFiles;

class FaultTest : public ClusterTest {
 protected:
  /// Waits until `what` is so, while the bake runs.
  bool Await(BackgroundProcess* bake, const std::function<bool()>& what) {
    for (int i = 0; i < 30'000 && bake->Running(); ++i) {
      if (what()) return true;
      Sleep(0.002);
    }
    return what();
  }
  bool AwaitTasks(BackgroundProcess* bake, size_t count) {
    return Await(bake, [&] { return StoredFiles(store(), "tasks").size() >= count; });
  }
  void ExpectEnd(BackgroundProcess* bake) {
    EXPECT_EQ(bake->Wait(), 0) << Text("bakes.log") << Text("workers.log");
    CheckFinished();
    ExpectArchive();
  }
};

TEST_F(FaultTest, ComputesDamagedChunksAgainAndNoOthers) {
  const auto bake = StartBake();
  auto worker = StartWorker();
  ASSERT_TRUE(AwaitTasks(bake.get(), 3)) << Text("bakes.log");
  worker->Signal(SIGSTOP);  // the layer does not end while its chunks are damaged
  const std::vector<fs::path> chunks = StoredFiles(store(), "chunks");
  ASSERT_GE(chunks.size(), 3u);
  fs::resize_file(chunks[0], fs::file_size(chunks[0]) / 2);
  std::fstream flipped(chunks[1], std::ios::in | std::ios::out | std::ios::binary);
  flipped.seekg(-1, std::ios::end);
  const char last = static_cast<char>(flipped.get() ^ 1);
  flipped.seekp(-1, std::ios::end);
  flipped.put(last);
  flipped.close();
  CheckFinished();
  worker->Signal(SIGCONT);
  EXPECT_EQ(bake->Wait(), 0) << Text("bakes.log");
  ExpectArchive();
  size_t again = 0;
  for (const auto& [record, inode] : finished_) {
    struct stat info = {};
    ASSERT_EQ(stat(record.c_str(), &info), 0);
    again += info.st_ino != inode;
  }
  EXPECT_LE(again, 2u) << "more was computed again than was damaged";
  EXPECT_NE(Text("bakes.log").find("damaged"), std::string::npos) << Text("bakes.log");
}

TEST_F(FaultTest, WaitsForASlowWorkerThatLives) {
  const auto bake = StartBake();
  const auto slow = StartWorker();
  ASSERT_TRUE(AwaitTasks(bake.get(), 1)) << Text("bakes.log");
  const auto worker = StartWorker();
  while (bake->Running()) {  // a tenth of its speed; its lease is a second
    slow->Signal(SIGSTOP);
    Sleep(0.09);
    slow->Signal(SIGCONT);
    Sleep(0.01);
    CheckFinished();
  }
  ExpectEnd(bake.get());
}

TEST_F(FaultTest, AnOlderProgramLeavesAStoreOfANewerOneAlone) {
  // Files of a later version where this one looks for its own.
  const auto bake = StartBake();
  fs::path folder;
  const auto published = [&] {
    for (const auto& entry : fs::directory_iterator(store())) folder = entry.path();
    return fs::exists(folder / "rounds") && !fs::is_empty(folder / "rounds");
  };
  ASSERT_TRUE(Await(bake.get(), published)) << Text("bakes.log");
  bake->Signal(SIGTERM);
  bake->Wait();
  const fs::path strange = folder / "tasks" / "zz" / "from-a-newer-version";
  fs::create_directories(strange.parent_path());
  std::ofstream(strange) << "kept";
  for (const auto& round : fs::directory_iterator(folder / "rounds"))
    std::ofstream(round.path()) << "{\"version\": 2, \"tasks\": \"elsewhere\"}";
  const auto worker = StartWorker();
  const ProcessResult baked = RunProcess(ClusterBakeCommand());
  EXPECT_EQ(baked.exit_code, 0) << baked.err << Text("workers.log");
  EXPECT_TRUE(bake_fixture::BytesOf(folder_ / "cluster.glint") == expected_);
  EXPECT_TRUE(fs::exists(strange));
}

/// A store on a file system of the test's own, which no other process sees.
class FaultyDiskTest : public FaultTest {
 protected:
  static constexpr char kSize[] = "size=64m";

  void SetUp() override {
    FaultTest::SetUp();
    mounted_ = unshare(CLONE_NEWNS) == 0 && mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
               mount("none", store().c_str(), "tmpfs", 0, kSize) == 0;
    if (!mounted_) std::cout << "not run: mounting is not permitted here: " << std::strerror(errno) << "\n";
  }
  void TearDown() override {
    if (mounted_) umount2(store().c_str(), MNT_DETACH);
  }
  bool mounted_ = false;
};

TEST_F(FaultyDiskTest, GoesOnWhenAFullDiskHasRoomAgain) {
  if (!mounted_) return;
  auto bake = StartBake();
  const auto worker = StartWorker();
  ASSERT_TRUE(AwaitTasks(bake.get(), 2)) << Text("bakes.log");
  const fs::path ballast = store() / "ballast";
  std::ofstream fill(ballast, std::ios::binary);
  const std::vector<char> block(1 << 16);
  while (fill.write(block.data(), static_cast<std::streamsize>(block.size())).flush()) {
  }
  fill.close();
  const auto full = [&] {
    return Text("workers.log").find("No space left") != std::string::npos || !bake->Running();
  };
  EXPECT_TRUE(Await(bake.get(), full)) << Text("workers.log");
  CheckFinished();
  fs::remove(ballast);
  // The coordinator itself ends where it cannot write.
  if (bake->Wait() != 0) bake = StartBake();
  ExpectEnd(bake.get());
  EXPECT_FALSE(fs::exists(store() / "failed"));
}

TEST_F(FaultyDiskTest, GoesOnWhenAFolderCanBeWrittenAgain) {
  if (!mounted_) return;
  auto bake = StartBake();
  const auto worker = StartWorker();
  ASSERT_TRUE(AwaitTasks(bake.get(), 2)) << Text("bakes.log");
  fs::path folder;
  for (const auto& entry : fs::directory_iterator(store()))
    if (entry.is_directory()) folder = entry.path() / "chunks";
  ASSERT_EQ(mount(folder.c_str(), folder.c_str(), nullptr, MS_BIND, nullptr), 0) << std::strerror(errno);
  ASSERT_EQ(mount(nullptr, folder.c_str(), nullptr, MS_REMOUNT | MS_BIND | MS_RDONLY, nullptr), 0)
      << std::strerror(errno);
  const auto refused = [&] { return Text("workers.log").find("Read-only") != std::string::npos; };
  EXPECT_TRUE(Await(bake.get(), refused)) << Text("workers.log");
  CheckFinished();
  ASSERT_EQ(umount2(folder.c_str(), MNT_DETACH), 0) << std::strerror(errno);
  ExpectEnd(bake.get());
}

/// Three NATS servers.
class ThreeServersTest : public FaultTest {
 protected:
  std::string url() const override { return cluster_.url(); }
  std::vector<std::string> More() const override { return {"--nats-replicas", "3"}; }
  NatsCluster cluster_{folder_ / "three"};
};

TEST_F(ThreeServersTest, GoesOnWithoutTheLeader) {
  const auto bake = StartBake();
  const auto worker = StartWorker();
  ASSERT_TRUE(AwaitTasks(bake.get(), 2)) << Text("bakes.log") << Text("workers.log");
  const int leader = cluster_.StreamLeader();
  ASSERT_GE(leader, 0);
  cluster_.Kill(leader);
  const size_t before = StoredFiles(store(), "tasks").size();
  ASSERT_TRUE(AwaitTasks(bake.get(), before + 3)) << "two of three servers are not enough";
  cluster_.Start(leader);
  ExpectEnd(bake.get());
}

}  // namespace
}  // namespace glint
