#include "coordinator/bake_target.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/archive/archive.h"
#include "common/round/settings_json.h"
#include "tests/base/temp_folder.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;
using bake_fixture::Generated;
using bake_fixture::SmallOptions;

size_t Of(BakeAxis axis) { return static_cast<size_t>(axis); }

/// A kept round at the default settings with the causes lobes, bits, angular, spatial, below, rays.
TargetRound Round(const std::array<double, kErrorCauses>& cause, double error = 0.2) {
  TargetRound round;
  round.settings.spatial_tolerance = 0.2f;
  round.error = error;
  round.cause = cause;
  round.seconds = 10;
  round.bytes = 1'000'000;
  round.kept = true;
  return round;
}

struct Steps {
  bool vertices, directions, rays, lobes, bits;
  bool operator==(const Steps&) const = default;
};

Steps Difference(const BakeSettings& from, const BakeSettings& to) {
  return {from.spatial_tolerance > to.spatial_tolerance, to.grid_level > from.grid_level,
          to.rays_per_kappa > from.rays_per_kappa, to.slice_lobes > from.slice_lobes, to.drop < from.drop};
}

TEST(NextStepTest, RefinesWhatStandsOut) {
  const BakeTarget target{.tolerance = 0.02f};
  const std::vector<TargetRound> angular{Round({0.01, 0.01, 0.1, 0.02, 0.2, 0.02})};
  const TargetStep step = NextStep(angular, target, 0);
  ASSERT_TRUE(step.settings);
  EXPECT_EQ(Difference(angular[0].settings, *step.settings), (Steps{false, true, false, false, false}));

  const std::vector<TargetRound> spatial{Round({0.01, 0.01, 0.02, 0.1, 0.2, 0.02})};
  EXPECT_EQ(Difference(spatial[0].settings, *NextStep(spatial, target, 0).settings),
            (Steps{true, false, false, false, false}));

  const std::vector<TargetRound> two{Round({0.08, 0.01, 0.1, 0.02, 0.2, 0.02})};
  EXPECT_EQ(Difference(two[0].settings, *NextStep(two, target, 0).settings),
            (Steps{false, true, false, true, false}));
}

TEST(NextStepTest, LeavesOutWhatTheToleranceDoesNotNeed) {
  const std::vector<TargetRound> rounds{Round({0.03, 0.01, 0.045, 0.084, 0.03, 0.02}, 0.104)};
  const auto step = [&](float tolerance) {
    return Difference(rounds[0].settings, *NextStep(rounds, {.tolerance = tolerance}, 0).settings);
  };
  EXPECT_EQ(step(0.085f), (Steps{true, false, false, false, false})) << "more vertices are enough";
  EXPECT_EQ(step(0.08f), (Steps{true, true, false, false, false}));
}

TEST(NextStepTest, TakesADearAxisThatTheToleranceNeedsAtOnce) {
  const std::vector<TargetRound> rounds{Round({0.033, 0.01, 0.03, 0.051, 0.033, 0.035}, 0.074)};
  const auto step = [&](const BakeTarget& target) {
    return Difference(rounds[0].settings, *NextStep(rounds, target, 30).settings);
  };
  EXPECT_TRUE(step({.tolerance = 0.054f}).vertices);
  EXPECT_EQ(step({.tolerance = 0.054f, .max_seconds = 100}), (Steps{false, false, true, true, false}))
      << "not in the time: what is best for its cost";
}

TEST(NextStepTest, KeepsToTheMeshWhereItIsTold) {
  std::vector<TargetRound> rounds{Round({0.01, 0.01, 0.02, 0.09, 0.2, 0.02}, 0.1)};
  rounds[0].settings.spatial_tolerance = 0;
  EXPECT_FALSE(NextStep(rounds, {.tolerance = 0.02f}, 0).settings) << "nothing else stands out";
}

TEST(NextStepTest, TriesTheOtherAxesWhereThoseNeededWereNoBetter) {
  std::vector<TargetRound> rounds{Round({0.036, 0.01, 0.034, 0.065, 0.02, 0.02}, 0.0876)};
  const BakeTarget target{.tolerance = 0.0873f};
  rounds.push_back(rounds[0]);
  rounds[1].settings = *NextStep({rounds.data(), 1}, target, 0).settings;
  rounds[1].kept = false;
  EXPECT_EQ(Difference(rounds[0].settings, rounds[1].settings), (Steps{true, false, false, false, false}));
  EXPECT_TRUE(NextStep(rounds, target, 0).settings);
}

TEST(NextStepTest, LeavesAloneWhatIsFixed) {
  BakeTarget target{.tolerance = 0.02f};
  target.fixed[Of(BakeAxis::kDirections)] = true;
  const std::vector<TargetRound> rounds{Round({0.06, 0.01, 0.1, 0.02, 0.2, 0.02})};
  EXPECT_EQ(Difference(rounds[0].settings, *NextStep(rounds, target, 0).settings),
            (Steps{false, false, false, true, false}));
  target.fixed[Of(BakeAxis::kLobes)] = true;
  const TargetStep none = NextStep(rounds, target, 0);
  EXPECT_FALSE(none.settings);
  EXPECT_FALSE(none.reached);
  EXPECT_NE(none.reason.find("angular 0.1"), std::string::npos) << none.reason;
}

TEST(NextStepTest, TakesAsManyStepsAsTheCauseIsAway) {
  const std::vector<TargetRound> rounds{Round({0, 0, 0, 0.19, 0, 0})};
  const auto tolerance = [&](float target) {
    return NextStep(rounds, {.tolerance = target}, 0).settings->spatial_tolerance;
  };
  const float one = tolerance(0.15f), two = tolerance(0.12f), most = tolerance(0.001f);
  EXPECT_LT(one, 0.2f);
  EXPECT_LT(two, one);
  EXPECT_LT(most, two);
  EXPECT_EQ(most, tolerance(0.0001f));
  const TargetStep cheap = NextStep(rounds, {.tolerance = 0.001f, .max_seconds = 100}, 30);
  EXPECT_EQ(cheap.settings->spatial_tolerance, one) << "what fits the time";
}

TEST(NextStepTest, EndsAtTheTolerance) {
  const std::vector<TargetRound> rounds{Round({0, 0, 0.1, 0, 0, 0}, 0.1)};
  EXPECT_TRUE(NextStep(rounds, {.tolerance = 0.1f}, 0).reached);
  EXPECT_TRUE(NextStep(rounds, {.tolerance = 0.09f}, 0).settings);
}

TEST(NextStepTest, DoesNotRefineBesideALargerCauseThatItCannotMend) {
  const std::vector<TargetRound> rounds{Round({0.02, 0.01, 0.02, 0.2, 0.2, 0.02})};
  BakeTarget target{.tolerance = 0.01f};
  target.fixed[Of(BakeAxis::kVertices)] = true;
  const TargetStep step = NextStep(rounds, target, 0);
  EXPECT_FALSE(step.settings);
  EXPECT_FALSE(step.reached);
  EXPECT_NE(step.reason.find("spatial"), std::string::npos) << step.reason;
}

TEST(NextStepTest, WithinBudgetsTheBestForItsCostComesFirst) {
  const std::vector<TargetRound> rounds{Round({0.1, 0.01, 0.1, 0.02, 0.2, 0.1})};
  const auto step = [&](double seconds_left, uint64_t max_bytes) {
    const TargetStep next = NextStep(rounds, {.max_seconds = 1000, .max_bytes = max_bytes}, seconds_left);
    return next.settings ? Difference(rounds[0].settings, *next.settings) : Steps{};
  };
  EXPECT_EQ(step(1000, 0), (Steps{false, false, true, true, false}));
  EXPECT_EQ(step(16, 0), (Steps{false, false, true, false, false}));
  EXPECT_EQ(step(10, 0), Steps{});
  EXPECT_EQ(step(1000, 1'100'000), (Steps{false, false, true, false, false})) << "rays cost no bytes";
  EXPECT_EQ(step(1000, 1'000'000), Steps{});
}

TEST(NextStepTest, EndsWhateverTheRoundsAre) {
  std::vector<TargetRound> rounds{Round({0.1, 0.1, 0.1, 0.1, 0.1, 0.1})};
  const BakeTarget target{.tolerance = 1e-6f};
  for (int i = 0; i < 1000; ++i) {
    const TargetStep step = NextStep(rounds, target, 0);
    if (!step.settings) break;
    for (const TargetRound& round : rounds)
      EXPECT_NE(SettingsToJson(round.settings), SettingsToJson(*step.settings));
    rounds.push_back(Round({0.1, 0.1, 0.1, 0.1, 0.1, 0.1}));
    rounds.back().settings = *step.settings;
    rounds.back().kept = i % 2 == 0;
  }
  EXPECT_LT(rounds.size(), 100u);
}

TEST(FirstSettingsTest, WhatIsFixedStays) {
  BakeTarget target{.tolerance = 0.1f};
  const BakeSettings settings;
  EXPECT_LT(FirstSettings(settings, target).grid_level, settings.grid_level);
  EXPECT_LT(FirstSettings(settings, target).max_rays, settings.max_rays);
  EXPECT_LT(FirstSettings(settings, {.tolerance = 0.02f}).spatial_tolerance,
            FirstSettings(settings, target).spatial_tolerance);
  EXPECT_GT(FirstSettings(settings, {.tolerance = 0.001f}).spatial_tolerance, 0.01f) << "it ends";
  EXPECT_GT(FirstSettings(settings, {.tolerance = 0.02f}).max_rays, FirstSettings(settings, target).max_rays);
  EXPECT_EQ(FirstSettings(settings, {.tolerance = 0.02f, .max_seconds = 60}).spatial_tolerance,
            FirstSettings(settings, {.tolerance = 1}).spatial_tolerance);
  target.fixed.fill(true);
  EXPECT_EQ(SettingsToJson(FirstSettings(settings, target)), SettingsToJson(settings));
}

// ---- Whole bakes ----

class BakeTargetTest : public testing::Test {
 protected:
  BakeTargetTest() {
    options_ = SmallOptions();
    options_.settings = {};
    options_.target.fixed[Of(BakeAxis::kVertices)] = true;  // small bakes, whatever the tolerance
    options_.max_layers = 1;
    options_.estimate_slices = 64;
  }

  Result<BakeReport> Run(const std::string& name = "out.glint") {
    return BakeScene(scene_, "scene", folder_.path() / name, options_);
  }
  nlohmann::json Target(const std::string& name = "out.glint") const {
    const std::vector<std::byte> bytes = BytesOf(folder_.path() / (name + ".json"));
    const auto* text = reinterpret_cast<const char*>(bytes.data());
    return nlohmann::json::parse(text, text + bytes.size())["target"];
  }
  std::vector<std::string> Files() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_.path())) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }

  const Scene scene_ = Generated("goblets", 700, 100);
  BakeOptions options_;
  TempFolder folder_;
};

TEST_F(BakeTargetTest, FindsSettingsThatReachTheTolerance) {
  options_.target.tolerance = 0.5f;
  ASSERT_TRUE(Run("coarse.glint").ok());
  const nlohmann::json coarse = Target("coarse.glint");
  EXPECT_TRUE(coarse["reached"]) << coarse["ended"];
  EXPECT_LE(coarse["error"], 0.5);

  options_.target.tolerance = 0.05f;
  const Result<BakeReport> report = Run();
  ASSERT_TRUE(report.ok()) << report.status().message();
  const nlohmann::json fine = Target();
  ASSERT_GT(fine["rounds"].size(), coarse["rounds"].size());
  EXPECT_LT(fine["error"], coarse["error"]);
  EXPECT_EQ(fine["reached"].get<bool>(), fine["error"].get<double>() <= 0.05);
  const Result<Archive> archive = Archive::Open(folder_.path() / "out.glint");
  ASSERT_TRUE(archive.ok()) << archive.status().message();
  EXPECT_EQ(archive->archive_key(), report->archive_key);
  EXPECT_EQ(Files(),
            (std::vector<std::string>{"coarse.glint", "coarse.glint.json", "out.glint", "out.glint.json"}));
}

TEST_F(BakeTargetTest, FindsHowManyVerticesItTakes) {
  options_.target = {.tolerance = 0.5f};
  ASSERT_TRUE(Run("coarse.glint").ok());
  options_.target.tolerance = 0.9f * Target("coarse.glint")["error"].get<float>();
  ASSERT_TRUE(Run().ok());
  const auto rows = [&](const char* name) {
    return Archive::Open(folder_.path() / name)->domain().row_count();
  };
  EXPECT_LT(rows("coarse.glint"), scene_.positions.size());
  EXPECT_GT(rows("out.glint"), rows("coarse.glint"));
}

TEST_F(BakeTargetTest, StoppedAnywhereItGoesOnToTheSameBytes) {
  options_.target.tolerance = 0.05f;
  ASSERT_TRUE(Run("whole.glint").ok());
  const size_t rounds = Target("whole.glint")["rounds"].size();
  ASSERT_GE(rounds, 2u);
  int stops = 0;
  for (int calls = 40;; calls += 40) {
    int left = calls;
    options_.stop = [&left] { return --left < 0; };
    const Result<BakeReport> report = Run();
    if (report.ok()) break;
    ASSERT_EQ(report.status().kind(), ErrorKind::kInterrupted) << report.status().message();
    ++stops;
  }
  EXPECT_GE(stops, 1);
  EXPECT_EQ(Target()["rounds"].size(), rounds);
  EXPECT_EQ(BytesOf(folder_.path() / "out.glint"), BytesOf(folder_.path() / "whole.glint"));
}

TEST_F(BakeTargetTest, FinishedRoundsAreNotBakedAgain) {
  options_.target.tolerance = 0.05f;
  size_t begun = 0, allowed = 2;
  options_.begins = [&begun](const Digest&) { ++begun; };
  options_.stop = [&] { return begun > allowed; };
  ASSERT_EQ(Run().status().kind(), ErrorKind::kInterrupted);
  ASSERT_TRUE(Archive::Open(folder_.path() / "out.glint").ok()) << "the best so far is there";
  // As after a kill between the note of a round and its archive's move.
  fs::rename(folder_.path() / "out.glint", folder_.path() / "out.glint.next");
  options_.stop = {};
  begun = 0;
  ASSERT_TRUE(Run().ok());
  EXPECT_EQ(begun, Target()["rounds"].size() - 2);
}

TEST_F(BakeTargetTest, RoundsWhoseBestIsLostAreBakedAgain) {
  options_.target.tolerance = 0.05f;
  size_t begun = 0;
  options_.begins = [&begun](const Digest&) { ++begun; };
  options_.stop = [&] { return begun > 1; };
  ASSERT_EQ(Run().status().kind(), ErrorKind::kInterrupted);
  fs::remove(folder_.path() / "out.glint");
  options_.stop = {};
  begun = 0;
  ASSERT_TRUE(Run().ok());
  EXPECT_EQ(begun, Target()["rounds"].size());
}

TEST_F(BakeTargetTest, KeepsWithinBytes) {
  options_.target.tolerance = 0.001f;
  ASSERT_TRUE(Run("any.glint").ok());
  const uint64_t any = fs::file_size(folder_.path() / "any.glint");
  options_.target.tolerance = 0;
  options_.target.max_bytes = any - 1;
  ASSERT_TRUE(Run().ok());
  EXPECT_LE(fs::file_size(folder_.path() / "out.glint"), any - 1);

  options_.target.max_bytes = 1000;
  const Result<BakeReport> none = Run("none.glint");
  EXPECT_EQ(none.status().kind(), ErrorKind::kLimit);
  EXPECT_FALSE(fs::exists(folder_.path() / "none.glint"));
}

TEST_F(BakeTargetTest, ATimeThatIsOverIsALimit) {
  options_.target.max_seconds = 1e-6;
  const Result<BakeReport> report = Run();
  EXPECT_EQ(report.status().kind(), ErrorKind::kLimit);
  EXPECT_TRUE(Files().empty()) << "nothing of it is kept";
}

TEST_F(BakeTargetTest, NeedsAnEstimate) {
  options_.target.tolerance = 0.1f;
  options_.estimate_slices = 0;
  EXPECT_EQ(Run().status().kind(), ErrorKind::kUsage);
}

}  // namespace
}  // namespace glint
