// Real processes of the program, ended at named and at random moments.

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "tests/base/process.h"
#include "tests/base/temp_folder.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;
using bake_fixture::StoredFiles;
using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// A small scene as a file, and what an undisturbed bake makes of it.
class BakeCrashTest : public testing::Test {
 protected:
  void SetUp() override {
    const Status saved = SaveScene(bake_fixture::Generated("planes"), folder_ / "scene.glb");
    ASSERT_TRUE(saved.ok()) << saved.message();
    const auto begin = Clock::now();
    ASSERT_EQ(Bake().exit_code, 0);
    seconds_ = SecondsSince(begin);
    expected_ = BytesOf(out());
    tasks_ = Report()["tasks"];
    Clear();
  }

  ProcessResult Bake(const std::vector<std::string>& environment = {}, const ProcessSignal& stop = {}) const {
    std::vector<std::string> command = {GLINT_PROGRAM, "bake",         (folder_ / "scene.glb").string(),
                                        "-o",          out().string(), "--directions",
                                        "162",         "--layers",     "1",
                                        "--max-rays",  "512",          "--vertices-per-task",
                                        "100",         "--threads",    "2"};
    command.insert(command.end(), more_arguments_.begin(), more_arguments_.end());
    return RunProcess(command, environment, stop);
  }
  /// Ends bakes, each one as `end` says (from 1 on), until one gets to its end; then checks what it left.
  template <class End>
  void BakeThroughKills(const End& end) {
    size_t finished = 0;
    for (int attempt = 1;; ++attempt) {
      ASSERT_LE(attempt, 40) << "does not get on";
      const size_t before = finished;
      const ProcessResult result = end(attempt);
      if (result.exit_code == 0) {
        EXPECT_EQ(Report()["tasks_reused"], before);
        EXPECT_FALSE(fs::exists(work()));
        break;
      }
      ASSERT_EQ(result.signal, SIGKILL) << result.err;
      if (fs::exists(report())) break;  // ended while it took the work folder away, which nobody needs now
      finished = StoredFiles(work(), "tasks").size();
      EXPECT_GE(finished, before);
      EXPECT_TRUE(!fs::exists(out()) || BytesOf(out()) == expected_) << "a part of an archive";
    }
    EXPECT_TRUE(BytesOf(out()) == expected_);
    EXPECT_EQ(Report()["tasks"], tasks_);
    Clear();
  }
  void Clear() const {
    fs::remove(out());
    fs::remove(report());
    fs::remove_all(work());
  }
  nlohmann::json Report() const {
    const auto bytes = BytesOf(report());
    const auto* text = reinterpret_cast<const char*>(bytes.data());
    return nlohmann::json::parse(text, text + bytes.size());
  }
  fs::path out() const { return folder_ / "out.glint"; }
  fs::path report() const { return folder_ / "out.glint.json"; }
  fs::path work() const { return folder_ / "out.glint.work"; }

  const TempFolder folder_;
  std::vector<std::string> more_arguments_;
  double seconds_ = 0;
  size_t tasks_ = 0;
  std::vector<std::byte> expected_;
};

class BakeCrashPointTest : public BakeCrashTest, public testing::WithParamInterface<const char*> {};

TEST_P(BakeCrashPointTest, GoesOnWhereItWas) {
  int kills = 0;
  // Later in each process, so that every kind of file is hit: chunks, records, the archive, the report.
  BakeThroughKills([&](int attempt) {
    ProcessResult result =
        Bake({"GLINT_CRASH_AT=" + std::string(GetParam()) + ":" + std::to_string(attempt)});
    kills += result.signal == SIGKILL;
    return result;
  });
  EXPECT_GE(kills, 3);
}

INSTANTIATE_TEST_SUITE_P(Points, BakeCrashPointTest,
                         testing::Values("before-write", "after-write", "before-rename", "after-rename",
                                         "after-dir-fsync"),
                         [](const auto& point) {
                           std::string name = point.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST_F(BakeCrashTest, GoesOnAfterKillsAtTheArchiveItself) {
  // The files of an undisturbed bake: a chunk and a record a task, then the archive, then the report.
  for (const size_t file : {2 * tasks_ + 1, 2 * tasks_ + 2})
    for (const char* point : {"before-write", "before-rename", "after-rename"}) {
      const ProcessResult killed =
          Bake({"GLINT_CRASH_AT=" + std::string(point) + ":" + std::to_string(file)});
      ASSERT_EQ(killed.signal, SIGKILL) << point << " of file " << file;
      EXPECT_EQ(StoredFiles(work(), "tasks").size(), tasks_);
      ASSERT_EQ(Bake().exit_code, 0);
      EXPECT_EQ(Report()["tasks_reused"], tasks_);
      EXPECT_TRUE(BytesOf(out()) == expected_);
      Clear();
    }
}

TEST_F(BakeCrashTest, GoesOnAfterKillsAtRandomMoments) {
  std::mt19937 random(20260701);
  for (int round = 0; round < 4; ++round)
    BakeThroughKills([&](int attempt) {
      // Ever later, so that it comes to an end on a busy machine too.
      const double most = seconds_ * (0.5 + 0.1 * attempt);
      const double seconds = std::uniform_real_distribution<double>(0, most)(random);
      const auto begin = Clock::now();
      return Bake({}, {SIGKILL, [=] { return SecondsSince(begin) >= seconds; }});
    });
}

class BakeStopTest : public BakeCrashTest, public testing::WithParamInterface<int> {};

TEST_P(BakeStopTest, EndsInOrderAndGoesOn) {
  const auto some_tasks = [this] { return StoredFiles(work(), "tasks").size() >= 2; };
  const ProcessResult stopped = Bake({}, {GetParam(), some_tasks});
  ASSERT_EQ(stopped.exit_code, 5) << stopped.err;
  EXPECT_NE(stopped.err.find("run the same command again to go on"), std::string::npos) << stopped.err;
  EXPECT_FALSE(fs::exists(out()));
  const size_t finished = StoredFiles(work(), "tasks").size();
  EXPECT_GE(finished, 2u);
  EXPECT_LT(finished, tasks_);
  ASSERT_EQ(Bake().exit_code, 0);
  EXPECT_EQ(Report()["tasks_reused"], finished);
  EXPECT_TRUE(BytesOf(out()) == expected_);
}

INSTANTIATE_TEST_SUITE_P(Signals, BakeStopTest, testing::Values(SIGINT, SIGTERM),
                         [](const auto& s) { return s.param == SIGINT ? "Interrupt" : "Terminate"; });

/// Bakes that choose their vertices.
class RefinedCrashTest : public BakeCrashTest {
 protected:
  RefinedCrashTest() { more_arguments_ = {"--spatial-tolerance", "0.1", "--smallest-edge", "0.05"}; }
};

TEST_F(RefinedCrashTest, GoesOnWhereItWas) {
  int kills = 0;
  BakeThroughKills([&](int attempt) {
    const ProcessResult result = Bake({"GLINT_CRASH_AT=after-rename:" + std::to_string(attempt)});
    kills += result.signal == SIGKILL;
    return result;
  });
  EXPECT_GE(kills, 3);
}

}  // namespace
}  // namespace glint
