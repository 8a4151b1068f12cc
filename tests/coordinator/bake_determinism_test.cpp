// The archive's bytes are a function of scene and settings alone.

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <numeric>
#include <random>

#include "coordinator/layer.h"
#include "coordinator/local_executor.h"
#include "tests/base/temp_folder.h"
#include "tests/coordinator/bake_fixture.h"
#include "tests/coordinator/baked.h"

namespace glint {
namespace {

using bake_fixture::BakeHere;
using bake_fixture::BallOnFloor;
using bake_fixture::Generated;
using bake_fixture::GeneratedPaint;
using bake_fixture::SmallOptions;

struct Case {
  const char* name;
  GatherMethod method;
  Scene (*scene)();
  float angular_tolerance = 0, spatial_tolerance = 0;
};

class BakeDeterminismTest : public testing::TestWithParam<Case> {};

/// How a bake may be spread over the machine.
struct Spread {
  int threads;
  uint32_t vertices_per_task, directions_per_task;
  uint64_t memory_bytes;
};

TEST_P(BakeDeterminismTest, ThreadsPartitionAndMemoryDoNotShow) {
  const Scene scene = GetParam().scene();
  BakeOptions options = SmallOptions(GetParam().method);
  options.settings.angular_tolerance = GetParam().angular_tolerance;
  options.settings.grid_level = GetParam().angular_tolerance > 0 ? 2 : 1;
  options.settings.base_level = 0;
  options.settings.spatial_tolerance = GetParam().spatial_tolerance;
  options.settings.smallest_edge = 1.0f / 32;
  options.threads = 1;
  const auto expected = BakeHere(scene, options);
  ASSERT_FALSE(expected->bytes.empty());
  ASSERT_EQ(expected->report.layers.size(), 3u);
  EXPECT_GT(expected->report.layers[0].stored[0], 0u);
  EXPECT_GT(expected->report.layers[1].stored[0], 0u);
  EXPECT_GT(expected->report.layers[2].stored[0], 0u);

  for (const Spread& spread : {Spread{2, 0, 0, 0}, Spread{3, 0, 0, 0}, Spread{2, 37, 0, 1},
                               Spread{3, 200, 13, 0}, Spread{1, 100000, 1000, 1 << 16}}) {
    options.threads = spread.threads;
    options.vertices_per_task = spread.vertices_per_task;
    options.directions_per_task = spread.directions_per_task;
    options.memory_bytes = spread.memory_bytes;
    const auto baked = BakeHere(scene, options);
    const auto label = testing::Message() << spread.threads << " threads, " << spread.vertices_per_task
                                          << " vertices and " << spread.directions_per_task
                                          << " directions a task, " << spread.memory_bytes << " bytes";
    EXPECT_TRUE(baked->bytes == expected->bytes) << label;
    EXPECT_EQ(baked->report.deterministic_json, expected->report.deterministic_json) << label;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, BakeDeterminismTest,
    testing::Values(
        Case{"SharedKnot", GatherMethod::kShared, [] { return Generated("knot"); }},
        Case{"PaperKnot", GatherMethod::kPaper, [] { return Generated("knot"); }},
        Case{"SharedPaint", GatherMethod::kShared, [] { return GeneratedPaint("planes"); }},
        Case{"PaperPaint", GatherMethod::kPaper, [] { return GeneratedPaint("planes"); }},
        Case{"NestedKnot", GatherMethod::kShared, [] { return Generated("knot"); }, 0.05f},
        Case{"NestedPaint", GatherMethod::kShared, [] { return GeneratedPaint("planes"); }, 0.05f},
        Case{"SharpKnot", GatherMethod::kShared, [] { return Generated("knot", 500, 4096); }},
        Case{"SharpNestedKnot", GatherMethod::kShared, [] { return Generated("knot", 500, 4096); }, 0.05f},
        Case{"RefinedFloor", GatherMethod::kShared, BallOnFloor, 0, 0.2f},
        Case{"RefinedPaint", GatherMethod::kShared, [] { return GeneratedPaint("planes"); }, 0, 0.2f},
        Case{"RefinedPaper", GatherMethod::kPaper, BallOnFloor, 0, 0.2f},
        Case{"RefinedNestedFloor", GatherMethod::kShared, BallOnFloor, 0.05f, 0.2f}),
    [](const auto& c) { return std::string(c.param.name); });

TEST(BakeSettingsTest, WhatDecidesTheResultShows) {
  const Scene scene = Generated("planes", 500, 4096);  // sharp enough for rays of slices' own
  BakeOptions options = SmallOptions();
  options.max_layers = 1;
  const auto expected = BakeHere(scene, options);
  const std::function<void(BakeOptions*)> changes[] = {
      [](BakeOptions* o) { o->settings.seed = 2; },
      [](BakeOptions* o) { o->settings.max_rays = 1024; },
      [](BakeOptions* o) { o->settings.drop = 0.1f; },
      [](BakeOptions* o) { o->settings.split_levels = 2; },
      [](BakeOptions* o) { o->settings.own_rays = 16; },
      [](BakeOptions* o) { o->settings.method = GatherMethod::kPaper; },
      [](BakeOptions* o) { o->settings.angular_tolerance = 0.1f, o->settings.base_level = 0; },
      [](BakeOptions* o) { o->settings.spatial_tolerance = 0.2f; },
      [](BakeOptions* o) { o->settings.subdivide = 1; }};
  for (const auto& change : changes) {
    BakeOptions changed = options;
    change(&changed);
    EXPECT_FALSE(BakeHere(scene, changed)->bytes == expected->bytes);
  }
}

TEST(BakeSettingsTest, WhatDecidesTheArchiveShowsInItsKey) {
  const Scene scene = Generated("planes");
  BakeOptions options = SmallOptions();
  options.max_layers = 1;
  const Digest expected = BakeHere(scene, options)->report.archive_key;
  options.threads = 1;
  options.vertices_per_task = 17;
  EXPECT_EQ(BakeHere(scene, options)->report.archive_key, expected);
  const std::function<void(BakeOptions*)> changes[] = {
      [](BakeOptions* o) { o->settings.seed = 2; }, [](BakeOptions* o) { o->max_layers = 0; },
      [](BakeOptions* o) { o->layer_tolerance = 0.5f; },
      [](BakeOptions* o) { o->table_form = TableForm::kClassic; }};
  for (const auto& change : changes) {
    BakeOptions changed = options;
    change(&changed);
    const auto baked = BakeHere(scene, changed);
    EXPECT_NE(baked->report.archive_key, expected);
    ASSERT_TRUE(baked->archive);
    EXPECT_EQ(baked->archive->archive_key(), baked->report.archive_key);
    EXPECT_TRUE(baked->report.json.find(baked->report.archive_key.Hex()) != std::string::npos);
  }
  Scene other_camera = Generated("planes");
  other_camera.cameras.at(0).name += "2";
  EXPECT_NE(BakeHere(other_camera, options)->report.archive_key, expected);
}

TEST(BakeSettingsTest, NumbersOfLayersThatNoArchiveHoldsAreRefused) {
  const TempFolder folder;
  BakeOptions options = SmallOptions();
  for (const int layers : {-1, kMaxIndirectLayers + 1}) {
    options.max_layers = layers;
    const Status status = BakeScene(Generated("planes"), "scene", folder / "out.glint", options).status();
    EXPECT_EQ(status.kind(), ErrorKind::kUsage) << layers;
  }
}

TEST(BakeSettingsTest, AScenesNameMayBeInAnyEncoding) {
  const TempFolder folder;
  BakeOptions options = SmallOptions();
  options.max_layers = 0;
  const Result<BakeReport> report =
      BakeScene(Generated("planes"), "caf\xe9.glb", folder / "out.glint", options);
  ASSERT_TRUE(report.ok()) << report.status().message();
  EXPECT_NE(report->json.find("caf\xef\xbf\xbd.glb"), std::string::npos) << "a replacement character";
}

TEST(BakeSettingsTest, ClassicTablesHoldTheSameSlices) {
  const Scene scene = Generated("planes");
  BakeOptions options = SmallOptions();
  const auto compact = BakeHere(scene, options);
  options.table_form = TableForm::kClassic;
  const auto classic = BakeHere(scene, options);
  const auto &a = compact->archive, &b = classic->archive;
  ASSERT_TRUE(a && b);
  ASSERT_EQ(a->layers().size(), b->layers().size());
  for (size_t layer = 0; layer < a->layers().size(); ++layer) {
    const SliceTableView &t = a->layers()[layer].specular[0], &u = b->layers()[layer].specular[0];
    ASSERT_EQ(t.entries(), u.entries());
    ASSERT_NE(t.form(), u.form());
    for (uint32_t row = 0; row < t.rows(); ++row)
      t.Row(row).ForEach([&](uint32_t column, const std::byte* entry) {
        const std::byte* other = u.Find(row, column);
        ASSERT_NE(other, nullptr);
        ASSERT_TRUE(std::equal(entry, entry + t.entry_bytes(), other));
      });
  }
}

// The executor and the merge alone: tasks in any order, each one handed out on its own.
TEST(MergeLayerTest, OrderOfTasksDoesNotShow) {
  const Scene scene = Generated("knot");
  const BakeDomain domain = BuildBakeDomain(scene, {}, 1);
  const DirectionGrid grid(1);
  const BakeSettings settings = SmallOptions().settings;
  std::vector<TaskSpec> tasks;
  for (uint32_t v = 0; v < domain.vertex_count(); v += 50)
    for (uint32_t c = 0; c < grid.size(); c += 20) {
      const GatherBlock block{v, std::min(50u, domain.vertex_count() - v), c, std::min(20u, grid.size() - c)};
      tasks.push_back({Hasher().Add(v).Add(c).Finish(), 0, block});
    }

  std::vector<Digest> digests;
  for (unsigned shuffle = 0; shuffle < 3; ++shuffle) {
    const TempFolder folder;
    Result<ChunkStore> store = ChunkStore::Open(folder.path());
    ASSERT_TRUE(store.ok());
    std::vector<TaskSpec> order = tasks;
    if (shuffle == 1) std::reverse(order.begin(), order.end());
    if (shuffle == 2) std::shuffle(order.begin(), order.end(), std::mt19937(7));
    const auto executor = MakeLocalExecutor({{}, domain, grid, settings, *store, 1, uint64_t{1} << 26});
    ASSERT_TRUE(executor.ok()) << executor.status().message();
    size_t done = 0;
    for (const TaskSpec& task : order)
      ASSERT_TRUE((*executor)->Run({{&task, 1}, nullptr}, [&](size_t, bool there) { done += !there; }).ok());
    EXPECT_EQ(done, tasks.size());
    const Result<Layer> layer = MergeLayer(*store, tasks, domain, grid, settings, TableForm::kCompact, 2);
    ASSERT_TRUE(layer.ok()) << layer.status().message();
    digests.push_back(layer->digest);
    EXPECT_GT(layer->stored[0], 0u);
  }
  EXPECT_EQ(digests[0], digests[1]);
  EXPECT_EQ(digests[0], digests[2]);
}

}  // namespace
}  // namespace glint
