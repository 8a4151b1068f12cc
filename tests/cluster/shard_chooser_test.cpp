#include "worker/shard_chooser.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "common/queue/shard.h"

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

TEST(ShardChooserTest, DoesNotAskAgainForWhatOthersHave) {
  ShardChooser chooser(3, 1);
  chooser.Update(std::vector<uint64_t>{5, 3, 0});
  chooser.FoundEmpty(0);
  EXPECT_FALSE(chooser.Choose().waits) << "until the queue is asked";
  chooser.Update(std::vector<uint64_t>{5, 3, 0});
  EXPECT_EQ(chooser.Choose().shard, 1u);
  chooser.FoundEmpty(1);
  chooser.Update(std::vector<uint64_t>{4, 2, 0});
  EXPECT_FALSE(chooser.Choose().waits);
  chooser.Update(std::vector<uint64_t>{0, 2, 0});
  EXPECT_EQ(chooser.Choose().shard, 1u) << "one of them may come again";
  chooser.Took({Sha256({}), 0, 1});
  chooser.Update(std::vector<uint64_t>{0, 2, 0});
  EXPECT_TRUE(chooser.Choose().waits) << "of the next round";
}

TEST(ShardChooserTest, PrefersWhatItKeepsThenWhatIsLongest) {
  ShardChooser chooser(4, 1);
  chooser.Update(std::vector<uint64_t>{3, 5, 4, 0});
  EXPECT_EQ(chooser.Choose().shard, 1u);
  chooser.Keep({50, 20, 0, 1}, 100);  // of shard 2, which is 50 to 74
  chooser.Keep({90, 5, 0, 1}, 100);   // of shard 3, where nothing waits
  EXPECT_EQ(chooser.Choose().shard, 2u);
  for (int i = 0; i < 4; ++i) chooser.Took({{}, 0, 2});
  EXPECT_EQ(chooser.Choose().shard, 1u);
  for (int i = 0; i < 5; ++i) chooser.Took({{}, 0, 1});
  EXPECT_EQ(chooser.Choose().shard, 0u);
  EXPECT_TRUE(chooser.Choose().waits);
  chooser.FoundEmpty(0);
  EXPECT_FALSE(chooser.Choose().waits);
  EXPECT_EQ(chooser.Choose().shard, 2u) << "waits where its own tasks will come";
}

TEST(ShardChooserTest, ForgetsWhatWaitedInTheRoundBefore) {
  ShardChooser chooser(2, 1);
  chooser.Took({Sha256({}), 0, 0});
  chooser.Update(std::vector<uint64_t>{1, 1});
  chooser.Took({Digest{}, 0, 0});
  EXPECT_FALSE(chooser.Choose().waits)
      << "others may have taken what was seen to wait before the round's end";
}

TEST(ShardChooserTest, CountsAVertexOnce) {
  ShardChooser chooser(2, 1);
  chooser.Update(std::vector<uint64_t>{1, 1});
  for (int i = 0; i < 3; ++i) chooser.Keep({0, 10, 0, 1}, 100);
  chooser.Keep({50, 20, 0, 1}, 100);
  EXPECT_EQ(chooser.Choose().shard, 1u);
}

TEST(ShardChooserTest, WorkersBeginInUnlikePlaces) {
  std::set<uint32_t> first;
  for (uint64_t seed = 0; seed < 50; ++seed) {
    ShardChooser chooser(16, seed);
    chooser.Update(std::vector<uint64_t>(16, 3));
    first.insert(chooser.Choose().shard);
  }
  EXPECT_GT(first.size(), 8u);
}

TEST(ChooseBakeTest, GoesByPriority) {
  const std::vector<QueuedBake> bakes = {{{}, "", 1, 30}, {{}, "", 4, 30}};
  std::mt19937 random(1);
  std::map<size_t, int> chosen;
  for (int i = 0; i < 5000; ++i) ++chosen[ChooseBake(bakes, &random)];
  EXPECT_NEAR(chosen[1] / 5000.0, 0.8, 0.03);
}

}  // namespace
}  // namespace glint
