#include "coordinator/partition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <set>

#include "common/queue/shard.h"
#include "common/round/round_files.h"
#include "coordinator/round_plan.h"
#include "tests/base/temp_folder.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

using Work = std::vector<VertexWork>;

double Seconds(const GatherBlock& block, const Work& work) {
  const auto begin = work.begin() + block.first_vertex;
  return std::accumulate(begin, begin + block.vertices, 0.0,
                         [](double sum, const VertexWork& w) { return sum + w.seconds; });
}
Work Alike(size_t vertices, float seconds) { return Work(vertices, {seconds, std::nullopt}); }

void ExpectCovers(const std::vector<GatherBlock>& blocks, uint32_t vertices, uint32_t columns) {
  uint64_t cells = 0;
  for (size_t i = 0; i < blocks.size(); ++i) {
    cells += uint64_t{blocks[i].vertices} * blocks[i].columns;
    if (i == 0) continue;
    const auto begin = [](const GatherBlock& b) { return std::pair(b.first_vertex, b.first_column); };
    EXPECT_LT(begin(blocks[i - 1]), begin(blocks[i]));
  }
  EXPECT_EQ(cells, uint64_t{vertices} * columns);
}

TEST(PartitionTest, TasksTakeAlikeWhereVerticesDoNot) {
  constexpr uint32_t kVertices = 200'000;
  Work seconds(kVertices);
  for (size_t v = 0; v < kVertices; ++v) seconds[v].seconds = v < kVertices / 2 ? 0.02f : 0.1f;
  const std::vector<GatherBlock> blocks = CutByCost(seconds, 642, 642);
  ExpectCovers(blocks, kVertices, 642);
  for (const GatherBlock& block : blocks) {
    EXPECT_GE(Seconds(block, seconds), 0.8 * kShortestTaskSeconds);
    EXPECT_LE(Seconds(block, seconds), 1.2 * kShortestTaskSeconds);
  }
}

TEST(PartitionTest, NoTaskIsOfTwoShards) {
  constexpr uint32_t kVertices = 10'007;
  const uint32_t shards = ShardsFor(kVertices);
  ASSERT_GT(shards, 8u);
  for (const float seconds : {0.0f, 0.001f, 0.01f, 3.0f}) {
    for (const GatherBlock& block : CutByCost(Alike(kVertices, seconds), 12, 12)) {
      EXPECT_EQ(ShardOf(block.first_vertex, kVertices, shards),
                ShardOf(block.first_vertex + block.vertices - 1, kVertices, shards));
    }
  }
}

TEST(PartitionTest, TasksAreNeitherLongNorTinyNorFew) {
  const Work dear = Alike(1'000'000, 1.0f);  // 11 days
  for (const GatherBlock& block : CutByCost(dear, 12, 12))
    EXPECT_LE(Seconds(block, dear), 1.05 * kLongestTaskSeconds);
  EXPECT_EQ(CutByCost(Alike(10'000, 0.001f), 12, 12).size(), kFewestTasks);
  EXPECT_EQ(CutByCost(Alike(500, 0.001f), 12, 12).size(), 7u) << "of at least 64 vertices";
  EXPECT_EQ(CutByCost(Alike(50, 30.0f), 12, 12).size(), 50u) << "each more than enough";
  EXPECT_TRUE(CutByCost({}, 12, 12).empty());
}

TEST(PartitionTest, DirectionsAreSplitAsAsked) {
  ExpectCovers(CutByCost(Alike(300, 0.01f), 42, 10), 300, 42);
  ExpectCovers(CutEvenly(300, 7, 42, 10), 300, 42);
}

TEST(PartitionTest, NoTaskIsOfTwoHomes) {
  Work work = Alike(1000, 1.0f);  // of which a task would have two
  for (size_t v = 301; v < 306; ++v) work[v].home = v < 304 ? 5 : 6;
  const std::vector<GatherBlock> blocks = CutByCost(work, 12, 12);
  ExpectCovers(blocks, 1000, 12);
  std::set<std::optional<uint32_t>> homes;
  for (const GatherBlock& block : blocks) {
    homes.insert(work[block.first_vertex].home);
    for (uint32_t v = 0; v < block.vertices; ++v)
      EXPECT_EQ(work[block.first_vertex + v].home, work[block.first_vertex].home);
  }
  EXPECT_EQ(homes.size(), 3u);
}

TEST(PartitionTest, SpreadsWhatIsKnownOfBlocksOverTheirVertices) {
  const std::vector<MeasuredBlock> blocks = {
      {{0, 2, 0, 5}, 4, {}}, {{0, 2, 5, 5}, 2, 7}, {{2, 4, 0, 10}, 4, {}}};
  const Work work = SpreadWork(blocks, 6);
  for (size_t v = 0; v < work.size(); ++v) {
    EXPECT_EQ(work[v].seconds, v < 2 ? 3 : 1);
    EXPECT_EQ(work[v].home, v < 2 ? std::optional(7u) : std::nullopt);
  }
}

class RoundPlanTest : public testing::Test {
 protected:
  Result<std::vector<TaskSpec>> Plan(int layer, std::span<const TaskSpec> before) const {
    return PlanRound({scene_.content, domain_, grid_, settings_, 0, 0, store_}, layer,
                     layer > 0 ? Sha256({}) : Digest{}, before);
  }
  void Finish(const std::vector<TaskSpec>& tasks, double first, double others) {
    for (size_t i = 0; i < tasks.size(); ++i)
      ASSERT_TRUE(store_.PutResult(tasks[i].key, {}, {i == 0 ? first : others, {}}).ok());
  }
  static std::vector<Digest> Keys(const std::vector<TaskSpec>& tasks) {
    std::vector<Digest> keys;
    for (const TaskSpec& task : tasks) keys.push_back(task.key);
    return keys;
  }

  const TempFolder folder_;
  const Scene scene_ = bake_fixture::Generated("planes", 5000);
  const BakeSettings settings_;
  const BakeDomain domain_ = BuildBakeDomain(scene_, settings_.fit, 1);
  const DirectionGrid grid_{settings_.grid_level};
  ChunkStore store_ = *ChunkStore::Open(folder_.path());
};

TEST_F(RoundPlanTest, LearnsFromTheLayerBefore) {
  const auto direct = Plan(0, {});
  ASSERT_TRUE(direct.ok()) << direct.status().message();
  Finish(*direct, 100, 1);
  const auto next = Plan(1, *direct);
  ASSERT_TRUE(next.ok()) << next.status().message();
  EXPECT_LT(next->front().block.vertices, direct->front().block.vertices);
  EXPECT_GE(next->back().block.vertices, direct->back().block.vertices);
}

TEST_F(RoundPlanTest, KnowsWhoHoldsTheHits) {
  const std::vector<TaskSpec> direct = *Plan(0, {});
  for (size_t i = 0; i < direct.size(); ++i) {
    EXPECT_EQ(direct[i].home, std::nullopt);
    const uint32_t home = i < direct.size() / 2 ? 0 : 3;
    ASSERT_TRUE(store_.PutResult(direct[i].key, {}, {1, home}).ok());
  }
  const uint32_t half = direct[direct.size() / 2].block.first_vertex;
  for (int planned = 0; planned < 2; ++planned) {  // anew, and from its file
    const std::vector<TaskSpec> next = *Plan(1, direct);
    for (const TaskSpec& task : next) EXPECT_EQ(task.home, task.block.first_vertex < half ? 0 : 3);
  }
}

TEST_F(RoundPlanTest, StaysAsItWasWhateverIsMeasuredLater) {
  const std::vector<TaskSpec> direct = *Plan(0, {});
  Finish(direct, 100, 1);
  const std::vector<Digest> planned = Keys(*Plan(1, direct));
  Finish(direct, 1, 100);  // as when a damaged chunk is computed again elsewhere
  EXPECT_EQ(Keys(*Plan(1, direct)), planned);

  // Without its file, or with one that is damaged, it is made anew.
  for (const auto& plan : fs::directory_iterator(folder_ / "plans")) fs::resize_file(plan.path(), 100);
  EXPECT_NE(Keys(*Plan(1, direct)), planned);
}

}  // namespace
}  // namespace glint
