// Work folders as an earlier bake, a bad disk or an administrator leaves them.

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "common/base/log.h"
#include "tests/base/temp_folder.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;
using bake_fixture::Generated;
using bake_fixture::SmallOptions;
using bake_fixture::StoredFiles;

class BakeResumeTest : public testing::Test {
 protected:
  BakeResumeTest() : scene_(Generated("planes")), options_(SmallOptions()) {
    options_.vertices_per_task = 64;
    options_.work_dir = folder_ / "work";
    options_.keep_work = true;
  }
  ~BakeResumeTest() override { ClearStop(); }

  Result<BakeReport> Run(const BakeProgressCallback& progress = {}) {
    return BakeScene(scene_, "scene", out(), options_, progress);
  }
  /// Bakes undisturbed, keeping the work folder, and takes the archive away.
  void BakeFirst() {
    const Result<BakeReport> report = Run();
    ASSERT_TRUE(report.ok()) << report.status().message();
    tasks_ = report->tasks;
    EXPECT_GE(tasks_, 12u);
    EXPECT_EQ(report->tasks_reused, 0u);
    expected_ = BytesOf(out());
    fs::remove(out());
  }
  /// The same call again: the same archive, and of the tasks only `computed` run again.
  void ExpectSameWith(uint64_t computed) {
    const Result<BakeReport> report = Run();
    ASSERT_TRUE(report.ok()) << report.status().message();
    EXPECT_TRUE(BytesOf(out()) == expected_);
    EXPECT_EQ(report->tasks, tasks_);
    EXPECT_EQ(report->tasks_reused, tasks_ - computed);
  }
  fs::path out() const { return folder_ / "out.glint"; }

  const TempFolder folder_;
  Scene scene_;
  BakeOptions options_;
  uint64_t tasks_ = 0;
  std::vector<std::byte> expected_;
};

TEST_F(BakeResumeTest, FinishedTasksAreNotComputedAgain) {
  BakeFirst();
  ExpectSameWith(0);
}

TEST_F(BakeResumeTest, TheWorkFolderGoesWhenItIsNotWanted) {
  options_.keep_work = false;
  ASSERT_TRUE(Run().ok());
  EXPECT_FALSE(fs::exists(options_.work_dir));
}

TEST_F(BakeResumeTest, WhatOthersKeepInTheWorkFolderStays) {
  ASSERT_TRUE(fs::create_directories(options_.work_dir / "chunks"));
  std::ofstream(options_.work_dir / "thesis.tex") << "years of work";
  std::ofstream(options_.work_dir / "chunks/mine") << "too";
  BakeOptions other = options_;
  other.settings.seed = 2;
  ASSERT_TRUE(BakeScene(scene_, "scene", folder_ / "other.glint", other).ok());  // keeps its chunks
  const size_t others = StoredFiles(options_.work_dir, "chunks").size();
  EXPECT_GT(others, 0u);
  options_.keep_work = false;
  ASSERT_TRUE(Run().ok());
  EXPECT_EQ(StoredFiles(options_.work_dir, "chunks").size(), others);
  EXPECT_TRUE(fs::exists(options_.work_dir / "thesis.tex"));
  EXPECT_TRUE(fs::exists(options_.work_dir / "chunks/mine"));
}

// Another bake of the same scene and settings ends, and takes its chunks away, while this one is at work.
TEST_F(BakeResumeTest, BakesOfOneKeyDoNotTakeEachOthersChunksAway) {
  options_.keep_work = false;
  bool other_ran = false;
  const Result<BakeReport> report = Run([&](const BakeProgress& progress) {
    if (other_ran || progress.stage != "layer 1") return;
    other_ran = true;
    EXPECT_TRUE(BakeScene(scene_, "scene", folder_ / "other.glint", options_).ok());
    EXPECT_GT(StoredFiles(options_.work_dir, "chunks").size(), 0u);
  });
  ASSERT_TRUE(report.ok()) << report.status().message();
  ASSERT_TRUE(other_ran);
  EXPECT_TRUE(BytesOf(out()) == BytesOf(folder_ / "other.glint"));
  EXPECT_FALSE(fs::exists(options_.work_dir)) << "the last one takes the folder away";
}

TEST_F(BakeResumeTest, AsManyBakesAtOnceAsYouLike) {
  options_.keep_work = false;
  options_.max_layers = 0;
  std::atomic<int> failures{0};
  {
    std::vector<std::jthread> bakes;
    for (uint32_t i = 0; i < 8; ++i)
      bakes.emplace_back([&, i] {
        BakeOptions options = options_;
        options.threads = 1;
        options.settings.seed = i / 4;
        failures += !BakeScene(scene_, "scene", folder_ / ("out" + std::to_string(i)), options).ok();
      });
  }
  EXPECT_EQ(failures, 0);
  EXPECT_FALSE(fs::exists(options_.work_dir));
}

TEST_F(BakeResumeTest, MoreLayersGoOnFromFewer) {
  options_.max_layers = 1;
  const Result<BakeReport> fewer = Run();
  options_.max_layers = 2;
  const Result<BakeReport> more = Run();
  ASSERT_TRUE(fewer.ok() && more.ok());
  EXPECT_EQ(more->tasks_reused, fewer->tasks);
  EXPECT_NE(more->archive_key, fewer->archive_key);
}

TEST_F(BakeResumeTest, TheFormOfTheTablesDoesNotMatterToTasks) {
  BakeFirst();
  options_.table_form = TableForm::kClassic;
  const Result<BakeReport> report = Run();
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->tasks_reused, tasks_);
}

TEST_F(BakeResumeTest, OtherSettingsFindNothing) {
  BakeFirst();
  options_.settings.seed = 2;
  const Result<BakeReport> report = Run();
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->tasks_reused, 0u);
}

TEST_F(BakeResumeTest, AStopIsKeptAndResumed) {
  BakeFirst();
  fs::remove_all(options_.work_dir);
  const Result<BakeReport> stopped = Run([](const BakeProgress& p) {
    if (p.stage == "layer 1" && p.done == 2) RequestStop();
  });
  ASSERT_FALSE(stopped.ok());
  EXPECT_EQ(stopped.status().kind(), ErrorKind::kInterrupted);
  EXPECT_FALSE(fs::exists(out()));
  ClearStop();
  const size_t finished = StoredFiles(options_.work_dir, "tasks").size();
  EXPECT_GE(finished, tasks_ / 3 + 2);
  EXPECT_LT(finished, tasks_);
  ExpectSameWith(tasks_ - finished);
}

TEST_F(BakeResumeTest, MissingRecordsAndChunksAreComputedAgain) {
  BakeFirst();
  fs::remove(StoredFiles(options_.work_dir, "tasks").at(0));
  ExpectSameWith(1);
  const auto chunks = StoredFiles(options_.work_dir, "chunks");
  EXPECT_EQ(chunks.size(), tasks_);
  fs::remove(chunks.at(1));
  fs::remove(chunks.at(2));
  ExpectSameWith(2);
}

void Truncate(const fs::path& file) { fs::resize_file(file, fs::file_size(file) / 2); }
void Empty(const fs::path& file) { fs::resize_file(file, 0); }
void FlipLast(const fs::path& file) {
  std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
  stream.seekg(-1, std::ios::end);
  const char last = static_cast<char>(stream.get() ^ 4);
  stream.seekp(-1, std::ios::end);
  stream.put(last);
}

TEST_F(BakeResumeTest, DamagedChunksAreComputedAgain) {
  BakeFirst();
  for (const auto& damage : {Truncate, Empty, FlipLast}) {
    damage(StoredFiles(options_.work_dir, "chunks").at(3));
    ExpectSameWith(1);
  }
  // All at once, whichever layers they belong to.
  for (const fs::path& chunk : StoredFiles(options_.work_dir, "chunks")) FlipLast(chunk);
  ExpectSameWith(tasks_);
}

TEST_F(BakeResumeTest, DamagedRecordsAreComputedAgain) {
  BakeFirst();
  for (const auto& damage : {Truncate, Empty, FlipLast}) {
    damage(StoredFiles(options_.work_dir, "tasks").at(2));
    ExpectSameWith(1);
  }
}

/// Folders' permissions mean nothing to root; while this lives, the process is somebody else.
class WithoutPrivileges {
 public:
  WithoutPrivileges() : user_(geteuid()) { ok_ = user_ != 0 || seteuid(kNobody) == 0; }
  ~WithoutPrivileges() { ok_ = seteuid(user_) == 0; }
  WithoutPrivileges(const WithoutPrivileges&) = delete;
  WithoutPrivileges& operator=(const WithoutPrivileges&) = delete;
  bool ok() const { return ok_; }

 private:
  static constexpr uid_t kNobody = 65534;
  const uid_t user_;
  bool ok_ = false;
};

TEST_F(BakeResumeTest, ChunksThatCannotBeReadAreNotDiscarded) {
  BakeFirst();
  for (const auto& entry : fs::recursive_directory_iterator(folder_.path()))
    fs::permissions(entry.path(), fs::perms::all);
  const fs::path chunk = StoredFiles(options_.work_dir, "chunks").at(1);
  fs::permissions(chunk, fs::perms::none);
  Status status;
  {
    const WithoutPrivileges nobody;
    ASSERT_TRUE(nobody.ok());
    status = Run().status();
  }
  EXPECT_EQ(status.kind(), ErrorKind::kIo);
  EXPECT_NE(status.message().find(chunk.string()), std::string::npos) << status.message();
  EXPECT_NE(status.message().find("ermission denied"), std::string::npos) << status.message();
  ASSERT_TRUE(fs::exists(chunk));
  fs::permissions(chunk, fs::perms::all);
  ExpectSameWith(0);
}

TEST_F(BakeResumeTest, SecondsOfALayerThatWasMendedAreAdded) {
  BakeFirst();
  FlipLast(StoredFiles(options_.work_dir, "chunks").at(3));
  const Result<BakeReport> report = Run();
  ASSERT_TRUE(report.ok()) << report.status().message();
  std::map<std::string, double> seconds;
  for (const auto& [stage, s] : report->stage_seconds) seconds[stage] += s;
  EXPECT_LT(seconds.size(), report->stage_seconds.size()) << "one stage came twice";
  const auto json = nlohmann::json::parse(report->json);
  for (const auto& [stage, s] : seconds) EXPECT_NEAR(json["seconds_by_stage"][stage], s, 1e-9) << stage;
}

TEST_F(BakeResumeTest, AReadOnlyWorkFolderIsAClearError) {
  fs::create_directories(options_.work_dir);
  ASSERT_EQ(chmod(options_.work_dir.c_str(), 0555), 0);
  Status status;
  {
    const WithoutPrivileges nobody;
    ASSERT_TRUE(nobody.ok());
    status = Run().status();
  }
  ASSERT_EQ(chmod(options_.work_dir.c_str(), 0755), 0);
  EXPECT_EQ(status.kind(), ErrorKind::kIo);
  EXPECT_NE(status.message().find(options_.work_dir.string()), std::string::npos) << status.message();
  EXPECT_NE(status.message().find("ermission denied"), std::string::npos) << status.message();
}

TEST_F(BakeResumeTest, AWorkFolderThatIsAFileIsAClearError) {
  std::ofstream(options_.work_dir) << "not a folder";
  const Status status = Run().status();
  EXPECT_EQ(status.kind(), ErrorKind::kIo);
  EXPECT_NE(status.message().find(options_.work_dir.string()), std::string::npos) << status.message();
}

TEST_F(BakeResumeTest, VerticesThatNoTriangleCanUseAreAClearError) {
  const size_t vertices = 3 * scene_.triangles.size() + 1;
  scene_.positions.resize(vertices, {0, 9, 0});
  scene_.normals.resize(vertices, {0, 1, 0});
  scene_.uvs.resize(vertices);
  scene_.colors.resize(vertices, glm::vec4(1));
  scene_.vertex_material.resize(vertices);
  const Status status = Run().status();
  EXPECT_EQ(status.kind(), ErrorKind::kBadInput) << status.message();
  EXPECT_NE(status.message().find("leave out"), std::string::npos) << status.message();
}

TEST_F(BakeResumeTest, AnOutputThatCannotBeWrittenLosesNothing) {
  BakeFirst();
  fs::create_directories(out() / "taken by a folder");
  EXPECT_EQ(Run().status().kind(), ErrorKind::kIo);
  fs::remove_all(out());
  ExpectSameWith(0);
}

}  // namespace
}  // namespace glint
