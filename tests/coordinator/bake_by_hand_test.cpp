// The tasks of a bake computed one by one from its folder, as `glint run-task` does, give the archive of the
// local bake.

#include <gtest/gtest.h>

#include "common/base/files.h"
#include "common/round/round_files.h"
#include "coordinator/manual_executor.h"
#include "tests/base/temp_folder.h"
#include "tests/coordinator/bake_fixture.h"
#include "worker/bake_runner.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;
using bake_fixture::GeneratedPaint;
using bake_fixture::SmallOptions;
using bake_fixture::StoredFiles;

class BakeByHandTest : public testing::TestWithParam<GatherMethod> {
 protected:
  BakeByHandTest() {
    options_.vertices_per_task = 150;
    options_.directions_per_task = 30;
    options_.keep_work = true;
  }
  Status Bake(const std::string& out, const ExecutorFactory& make_executor) {
    BakeOptions options = options_;
    options.make_executor = make_executor;
    return BakeScene(scene_, "scene", folder_ / out, options).status();
  }
  fs::path BakeFolder(const std::string& work) const {
    for (const auto& entry : fs::directory_iterator(folder_ / work)) return entry.path();
    ADD_FAILURE() << work << " is empty";
    return {};
  }
  std::vector<fs::path> Manifests(const fs::path& bake) const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(bake / "rounds")) files.push_back(entry.path());
    return files;
  }
  /// Runs every task of every round so far, last one first, each in a runner of its own if `fresh`; how many
  /// were computed.
  size_t RunAll(const fs::path& bake, bool fresh) {
    size_t computed = 0;
    Result<BakeRunner> shared = BakeRunner::Open(bake, 2, 0);
    for (const fs::path& path : Manifests(bake)) {
      const Result<RoundManifest> round = ReadManifest(path);
      EXPECT_TRUE(round.ok()) << round.status().message();
      for (size_t i = round->blocks.size(); i-- > 0;) {
        Result<BakeRunner> own = BakeRunner::Open(bake, 1, 0);
        const Result<bool> was_there = (fresh ? own : shared)->Run(*round, i);
        EXPECT_TRUE(was_there.ok()) << was_there.status().message();
        computed += was_there.ok() && !*was_there;
      }
    }
    return computed;
  }

  const TempFolder folder_;
  const Scene scene_ = GeneratedPaint("planes");
  BakeOptions options_ = SmallOptions(GetParam());
};

TEST_P(BakeByHandTest, GivesTheArchiveOfTheLocalBake) {
  ASSERT_TRUE(Bake("local.glint", {}).ok());
  const std::vector<fs::path> chunks = StoredFiles(folder_ / "local.glint.work", "chunks");

  size_t computed = 0;
  int rounds = 0;
  for (;; ++rounds) {
    ASSERT_LE(rounds, 3);
    const Status baked = Bake("hand.glint", MakeManualExecutor);
    if (baked.ok()) break;
    ASSERT_EQ(baked.kind(), ErrorKind::kInterrupted) << baked.message();
    EXPECT_NE(baked.message().find("glint run-task --manifest"), std::string::npos) << baked.message();
    computed += RunAll(BakeFolder("hand.glint.work"), rounds % 2 == 1);
    EXPECT_EQ(RunAll(BakeFolder("hand.glint.work"), true), 0u) << "computed again what was there";
  }
  EXPECT_EQ(rounds, 3);
  EXPECT_TRUE(BytesOf(folder_ / "hand.glint") == BytesOf(folder_ / "local.glint"));
  EXPECT_EQ(StoredFiles(folder_ / "hand.glint.work", "tasks").size(), computed);
  const auto same = StoredFiles(folder_ / "hand.glint.work", "chunks");
  ASSERT_EQ(same.size(), chunks.size());
  for (const fs::path& chunk : chunks) {
    const fs::path twin = BakeFolder("hand.glint.work") / fs::relative(chunk, BakeFolder("local.glint.work"));
    EXPECT_TRUE(BytesOf(twin) == BytesOf(chunk)) << chunk;
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, BakeByHandTest,
                         testing::Values(GatherMethod::kShared, GatherMethod::kPaper),
                         [](const auto& m) { return m.param == GatherMethod::kShared ? "Shared" : "Paper"; });

class RunTaskErrorTest : public testing::Test {
 protected:
  void SetUp() override {
    BakeOptions options = SmallOptions();
    options.work_dir = folder_ / "work";
    options.make_executor = MakeManualExecutor;
    const auto baked = BakeScene(bake_fixture::Generated("planes"), "scene", folder_ / "o.glint", options);
    ASSERT_EQ(baked.status().kind(), ErrorKind::kInterrupted);
    bake_ = fs::directory_iterator(folder_ / "work")->path();
    Result<RoundManifest> round = ReadManifest(fs::directory_iterator(bake_ / "rounds")->path());
    ASSERT_TRUE(round.ok());
    round_ = std::move(round).value();
  }
  Status Run(const RoundManifest& round, size_t index = 0) const {
    Result<BakeRunner> runner = BakeRunner::Open(bake_, 1, 0);
    EXPECT_TRUE(runner.ok());
    return runner->Run(round, index).status();
  }

  const TempFolder folder_;
  fs::path bake_;
  RoundManifest round_;
};

TEST_F(RunTaskErrorTest, SaysWhatIsWrong) {
  EXPECT_EQ(Run(round_, round_.blocks.size()).kind(), ErrorKind::kUsage);

  RoundManifest foreign = round_;
  foreign.execution = "glint 9.9.9";
  EXPECT_EQ(Run(foreign).kind(), ErrorKind::kMismatch);
  EXPECT_NE(Run(foreign).message().find("glint 9.9.9"), std::string::npos);

  RoundManifest beyond = round_;
  beyond.blocks[0].first_vertex = 1'000'000;
  EXPECT_EQ(Run(beyond).kind(), ErrorKind::kBadInput);

  RoundManifest later = round_;
  later.layer = 1;  // its input was never written
  EXPECT_EQ(Run(later).kind(), ErrorKind::kBadInput);
  EXPECT_NE(Run(later).message().find(later.InputKey().Hex()), std::string::npos);

  EXPECT_TRUE(Run(round_).ok());
}

TEST_F(RunTaskErrorTest, RefusesADamagedOrForeignInput) {
  const fs::path input = InputPath(bake_, round_.InputKey());
  std::vector<std::byte> bytes = BytesOf(input);
  bytes[bytes.size() / 2] ^= std::byte{1};
  ASSERT_TRUE(PublishFile(input, bytes).ok());
  EXPECT_EQ(Run(round_).kind(), ErrorKind::kBadInput);
  EXPECT_NE(Run(round_).message().find(input.string()), std::string::npos);

  // A sound input under another round's name.
  bytes[bytes.size() / 2] ^= std::byte{1};
  RoundManifest other = round_;
  other.settings.seed = 77;
  ASSERT_TRUE(PublishFile(InputPath(bake_, other.InputKey()), bytes).ok());
  EXPECT_EQ(Run(other).kind(), ErrorKind::kBadInput);
  EXPECT_NE(Run(other).message().find("not the input of this round"), std::string::npos);
}

/// Changes entries of the last layer's first table, and nothing that tells where they are.
void DamageEntries(const fs::path& path) {
  const Result<Archive> input = Archive::Open(path);
  ASSERT_TRUE(input.ok());
  const size_t tables = input->layers().back().specular.size() + 1;
  const SectionInfo table = input->sections()[input->sections().size() - tables];
  std::vector<std::byte> bytes = BytesOf(path);
  // Entries are most of a table, and its end.
  for (uint64_t i = table.stored_bytes / 2; i + 64 < table.stored_bytes; ++i)
    bytes[table.offset + i] ^= std::byte{1};
  ASSERT_TRUE(PublishFile(path, bytes).ok());
}

TEST_F(RunTaskErrorTest, RefusesDamagedRowsOfTheLayerBefore) {
  for (size_t i = 0; i < round_.blocks.size(); ++i) ASSERT_TRUE(Run(round_, i).ok());
  BakeOptions options = SmallOptions();
  options.work_dir = folder_ / "work";
  options.make_executor = MakeManualExecutor;
  const auto baked = BakeScene(bake_fixture::Generated("planes"), "scene", folder_ / "o.glint", options);
  ASSERT_EQ(baked.status().kind(), ErrorKind::kInterrupted);
  for (const auto& file : fs::directory_iterator(bake_ / "rounds"))
    if (Result<RoundManifest> round = ReadManifest(file.path()); round->layer == 1) round_ = *round;
  ASSERT_EQ(round_.layer, 1);

  const fs::path input = InputPath(bake_, round_.InputKey()), rows = InputRowsPath(bake_, round_.InputKey());
  const std::vector<std::byte> sound = BytesOf(input), sound_rows = BytesOf(rows);
  DamageEntries(input);
  Result<BakeRunner> runner = BakeRunner::Open(bake_, 1, 0);
  Status status;
  size_t task = 0;
  for (; task < round_.blocks.size() && status.ok(); ++task) status = runner->Run(round_, task).status();
  EXPECT_EQ(status.kind(), ErrorKind::kBadInput);
  EXPECT_NE(status.message().find(input.string()), std::string::npos) << status.message();

  ASSERT_TRUE(PublishFile(input, sound).ok());
  EXPECT_TRUE(runner->Run(round_, task - 1).ok()) << "a runner that had read the damaged one";
  fs::resize_file(rows, sound_rows.size() - 8);
  const size_t last = round_.blocks.size() - 1;
  EXPECT_EQ(Run(round_, last).kind(), ErrorKind::kBadInput);
  EXPECT_NE(Run(round_, last).message().find(rows.string()), std::string::npos);
  ASSERT_TRUE(PublishFile(rows, sound_rows).ok());
  for (size_t i = 0; i < round_.blocks.size(); ++i) EXPECT_TRUE(Run(round_, i).ok());
}

}  // namespace
}  // namespace glint
