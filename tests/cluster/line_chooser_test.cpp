#include "worker/line_chooser.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <memory>
#include <set>

#include "common/queue/shard.h"
#include "tests/base/temp_folder.h"
#include "worker/home_line.h"

namespace glint {
namespace {

TEST(ShardTest, CoversTheSurfaceInOrder) {
  constexpr uint32_t kVertices = 1001, kShards = 16;
  uint32_t last = 0;
  std::set<uint32_t> seen;
  for (uint32_t v = 0; v < kVertices; ++v) {
    const uint32_t shard = ShardOf(v, kVertices, kShards);
    EXPECT_GE(shard, last);
    last = shard;
    seen.insert(shard);
  }
  EXPECT_EQ(seen.size(), kShards);
  EXPECT_EQ(last, kShards - 1);
}

TEST(ShardTest, AreAsManyAsTheSurfaceNeeds) {
  EXPECT_EQ(ShardsFor(1), 1u);
  EXPECT_EQ(ShardsFor(3000), 4u);
  EXPECT_EQ(ShardsFor(4'000'000), kMaxShards);
}

using Messages = std::vector<uint64_t>;

/// A worker with home 2 of four lines, in a round.
class LineChooserTest : public testing::Test {
 protected:
  void Take(uint32_t line, int layer, double seconds = 1) {
    chooser_.Took({Sha256(std::as_bytes(std::span(&layer, 1))), 0, line}, layer);
    now_ += seconds;
    chooser_.Finished(seconds);
  }
  LineChooser::Choice Choose() { return chooser_.Choose(now_); }
  void Update(const Messages& messages) { chooser_.Update(messages, now_); }

  LineChooser chooser_{4, 2, 1};
  double now_ = 100;
};

TEST_F(LineChooserTest, BeginsAtHomeThenGoesWhereTasksAre) {
  EXPECT_EQ(Choose().line, 2u);
  EXPECT_TRUE(Choose().waits);
  chooser_.FoundEmpty(2);
  EXPECT_FALSE(Choose().waits) << "until the queue is asked";
  Update({0, 5, 0, 0});
  EXPECT_EQ(Choose().line, 1u);
  EXPECT_TRUE(Choose().waits);
}

TEST_F(LineChooserTest, GoesOnWithALineOfTheFirstLayer) {
  Take(1, 0);
  EXPECT_EQ(Choose().line, 1u);
  EXPECT_TRUE(Choose().waits) << "without asking the queue";
  chooser_.FoundEmpty(1);
  Update({3, 0, 0, 0});
  EXPECT_EQ(Choose().line, 0u);
}

TEST_F(LineChooserTest, ComesHomeInLaterLayers) {
  Take(1, 0);
  Take(1, 1);  // the first task of the next layer, which was another's
  EXPECT_EQ(Choose().line, 2u);
  EXPECT_TRUE(Choose().waits);
  chooser_.FoundEmpty(2);
  Update({8, 0, 0, 0});
  EXPECT_EQ(Choose().line, 0u);
  Take(0, 1);
  EXPECT_FALSE(Choose().waits) << "what waited before a task of some seconds says nothing";
  Update({7, 0, 1, 0});
  EXPECT_EQ(Choose().line, 2u) << "where one has come again";
}

TEST_F(LineChooserTest, LeavesTheLastTasksToWhomHoldsTheirHits) {
  Take(2, 1);
  chooser_.FoundEmpty(2);
  Update({3, 0, 0, 0});
  EXPECT_FALSE(Choose().waits);
  Update({4, 0, 0, 0});
  EXPECT_TRUE(Choose().waits) << "too many for one";
  Update({2, 0, 0, 0});
  EXPECT_FALSE(Choose().waits);
  now_ += 60;
  Update({2, 0, 0, 0});
  EXPECT_EQ(Choose().line, 0u);
  EXPECT_TRUE(Choose().waits) << "nobody comes for them";
}

TEST_F(LineChooserTest, LooksNowAndThenForWhatOthersHadForLong) {
  Take(2, 1);
  chooser_.FoundEmpty(2);
  Update({0, 1, 0, 0});
  now_ += 60;
  EXPECT_EQ(Choose().line, 1u);
  chooser_.FoundEmpty(1);
  int at_home = 0, around = 0;
  for (int i = 0; i < 10; ++i) {
    now_ += 60;
    Update({0, 1, 0, 0});
    const LineChooser::Choice choice = Choose();
    EXPECT_EQ(choice.line, choice.waits ? 1u : 2u);
    ++(choice.waits ? around : at_home);
    if (choice.waits) chooser_.FoundEmpty(1);
  }
  EXPECT_EQ(at_home, 5);
  EXPECT_EQ(around, 5);
}

TEST_F(LineChooserTest, PrefersLongLines) {
  chooser_.FoundEmpty(2);
  Update({2, 20, 0, 2});
  std::map<uint32_t, int> chosen;
  for (int i = 0; i < 1000; ++i) ++chosen[Choose().line];
  EXPECT_GT(chosen[1], 900);
  EXPECT_GT(chosen[0] + chosen[3], 0);
}

TEST(HomeLineTest, IsAnotherForEachWorkerAndFreeAgainAfterIt) {
  const TempFolder bake;
  const HomeLine first(bake.path(), 3, 7);
  EXPECT_EQ(first.line(), 1u);
  auto second = std::make_unique<HomeLine>(bake.path(), 3, 7);
  const HomeLine third(bake.path(), 3, 7);
  EXPECT_EQ((std::set{first.line(), second->line(), third.line()}), (std::set{0u, 1u, 2u}));
  const uint32_t freed = second->line();
  EXPECT_EQ(HomeLine(bake.path(), 3, 7).line(), 1u) << "none is free: shared";
  second.reset();
  EXPECT_EQ(HomeLine(bake.path(), 3, 7).line(), freed);
}

TEST(HomeLineTest, SaysWhoHasIt) {
  const TempFolder bake;
  EXPECT_EQ(HomeName(bake.path(), 1), "");
  const HomeLine home(bake.path(), 3, 7);
  EXPECT_TRUE(HomeName(bake.path(), 1).ends_with(":" + std::to_string(getpid())));
  std::ofstream(bake / "homes/2") << "a\x1b[2Jb\n";
  EXPECT_EQ(HomeName(bake.path(), 2), "a?[2Jb?") << "nothing that a terminal would obey";
}

TEST(HomeLineTest, IsALineWhereThereCanBeNoLocks) { EXPECT_EQ(HomeLine("/nowhere/at/all", 4, 6).line(), 2u); }

TEST(ChooseBakeTest, GoesByPriority) {
  const std::vector<QueuedBake> bakes = {{{}, "", 1, 30}, {{}, "", 4, 30}};
  std::mt19937 random(1);
  std::map<size_t, int> chosen;
  for (int i = 0; i < 5000; ++i) ++chosen[ChooseBake(bakes, &random)];
  EXPECT_NEAR(chosen[1] / 5000.0, 0.8, 0.03);
}

}  // namespace
}  // namespace glint
