#include "worker/lobe_rays.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <utility>
#include <vector>

#include "common/archive/lobe_codec.h"
#include "common/scene/generate.h"
#include "common/scene/mesh_builder.h"
#include "tests/worker/gathered_layer.h"

namespace glint {
namespace {

constexpr float kSharp = 30000;  ///< no lattice of 4096 cells resolves it

Material Mirror(bool double_sided = false) {
  Material material;
  material.model = MaterialModel::kPhong;
  material.exponent = kSharp;
  material.specular = glm::vec3(1);
  material.double_sided = double_sided;
  return material;
}

Scene Generated(const char* name, float exponent) {
  Result<Scene> scene = GenerateScene(name, {500, exponent});
  EXPECT_TRUE(scene.ok());
  return *scene;
}

/// A floor of vertices 0 to 80, and a ceiling at height 1 over its half x < 0, whose edge is seen as a great
/// circle.
Scene FloorUnderEdge(bool double_sided = false) {
  MeshBuilder builder;
  const uint16_t mirror = builder.AddMaterial(Mirror(double_sided));
  builder.AddPatch({-0.5, 0, 0.1}, {1, 0, 0}, {0, 0, -0.2}, 9, 9, mirror);
  builder.AddPatch({-40, 1, -40}, {40, 0, 0}, {0, 0, 80}, 2, 2, mirror);
  return builder.Finish({});
}
constexpr uint32_t kFloorVertices = 81;

/// Two squares of side 2 that face each other at distance 1.
Scene FacingMirrors() {
  MeshBuilder builder;
  const uint16_t mirror = builder.AddMaterial(Mirror());
  builder.AddPatch({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 9, 9, mirror);
  builder.AddPatch({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, 9, 9, mirror);
  return builder.Finish({});
}

struct Bench {
  Scene scene;
  BakeDomain domain;
  DirectionGrid grid;
  RayScene rays;
  GatherInput input;

  explicit Bench(Scene s, int level = 3, int base_level = DirectionGrid::kMaxLevel)
      : scene(std::move(s)),
        domain(BuildBakeDomain(scene, {}, 1)),
        grid(level, base_level),
        rays(scene, 1),
        input{domain, rays, grid} {}

  BlockResult Gather(const BakeSettings& settings, const GatherBlock& block) const {
    const auto gatherer = MakeGatherer(input, settings, 0);
    gatherer->BeginLayer(0, nullptr, 1);
    return gatherer->Gather(block);
  }
  BlockResult Gather(const BakeSettings& settings) const {
    return Gather(settings, {0, domain.vertex_count(), 0, grid.size()});
  }
};

BakeSettings WithOwnRays(int rays) {
  BakeSettings settings;
  settings.own_rays = rays;
  return settings;
}

void ExpectSame(const BlockResult& a, const BlockResult& b) {
  ASSERT_EQ(a.slots.size(), b.slots.size());
  for (size_t slot = 0; slot < a.slots.size(); ++slot) {
    EXPECT_EQ(a.slots[slot].counts, b.slots[slot].counts);
    EXPECT_EQ(a.slots[slot].columns, b.slots[slot].columns);
    EXPECT_TRUE(a.slots[slot].entries == b.slots[slot].entries);
  }
  EXPECT_EQ(a.counters.rays, b.counters.rays);
}

TEST(SharedViewTest, SaysWhetherABorderIsNear) {
  const auto view = [](float blocked, float resolution) {
    return ViewOf({.all = 2, .blocked = 2 * blocked}, resolution);
  };
  for (const float resolution : {0.001f, 0.1f, 0.7f}) {
    EXPECT_EQ(view(0, resolution), SharedView::kFree);
    EXPECT_EQ(view(0.3f, resolution), SharedView::kBorder);
    EXPECT_EQ(view(0.97f, resolution), SharedView::kBorder);
    EXPECT_EQ(view(1, resolution), SharedView::kBlocked);
  }
  // A border that is out of a mirror's lobe may be within a broader one.
  EXPECT_EQ(view(0.01f, 0.001f), SharedView::kFree);
  EXPECT_EQ(view(0.01f, 0.7f), SharedView::kBorder);
}

class LobeRaysTest : public testing::Test {
 protected:
  DrawnLobe Aimed(const glm::vec3& mu, float kappa = kSharp) const {
    return {40, false, 7, 0, {glm::normalize(mu), kappa}};
  }

  const Bench bench_{FloorUnderEdge(), 0};
  const SurfaceVertices surface_{bench_.domain, bench_.rays.epsilon()};
};

TEST_F(LobeRaysTest, DrawTheLobesMeanAndWidth) {
  for (const int count : {8, 32, 256}) {
    LobeRays rays(bench_.input, surface_, WithOwnRays(count));
    for (const float kappa : {100.0f, kSharp}) {
      const DrawnLobe drawn = Aimed({1, 1, 0.2f}, kappa);
      EXPECT_EQ(rays.Trace(drawn, SharedView::kBorder), static_cast<uint64_t>(count));
      ASSERT_EQ(rays.leaving(), count);
      const LightGroup mean = rays.Visible().total;
      const glm::dvec3 direction = mean.moment / mean.strength, mu(drawn.vmf.mu);
      EXPECT_NEAR((1 - glm::dot(direction, mu)) * double{kappa}, 1, 0.01);
      EXPECT_LT(glm::length(direction - mu * glm::dot(direction, mu)) * std::sqrt(double{kappa}),
                1 / std::sqrt(count));
    }
  }
}

TEST_F(LobeRaysTest, OneSurfaceTakesHalfOfThem) {
  LobeRays rays(bench_.input, surface_, WithOwnRays(32));
  EXPECT_EQ(rays.Trace(Aimed({-1, 0.5f, 0}), SharedView::kBlocked), 16u);
  EXPECT_EQ(rays.leaving(), 16);
  // The edge stands over the vertex: the shared rays were wrong.
  EXPECT_EQ(rays.Trace(Aimed({0, 1, 0}), SharedView::kBlocked), 16u + 32u);
  EXPECT_EQ(rays.leaving(), 32);
  EXPECT_NEAR(rays.Direct({{0, 1, 0}, kSharp}).visible, 0.5, 0.1);
}

TEST_F(LobeRaysTest, WhatPointsUnderTheSurfaceCountsNowhere) {
  LobeRays rays(bench_.input, surface_, WithOwnRays(64));
  EXPECT_LT(rays.Trace(Aimed({1, 0, 0}), SharedView::kBorder), 64u);  // along the floor
  EXPECT_NEAR(rays.leaving(), 32, 8);
  EXPECT_TRUE(rays.usable());
  EXPECT_EQ(rays.Direct({{1, 0, 0}, kSharp}).visible, 1);
  EXPECT_EQ(rays.Trace(Aimed({1, -1, 0}), SharedView::kBorder), 0u);
  EXPECT_FALSE(rays.usable());
}

/// rms over lobes that the edge cuts of their free part's error.
double ErrorAtEdge(const Bench& bench, const BakeSettings& settings) {
  const SurfaceVertices surface(bench.domain, bench.rays.epsilon());
  const BlockRows rows = bench.Gather(settings).slots[0];
  double square = 0;
  int cut = 0;
  size_t entry = 0;
  for (uint32_t v = 0; v < kFloorVertices; ++v) {
    std::vector<float> free(bench.grid.size(), 1);
    for (uint16_t i = 0; i < rows.counts[v]; ++i, ++entry)
      free[rows.columns[entry]] = DecodeDirect(rows.entries.data() + entry * kDirectEntryBytes).fraction;
    const glm::vec3 p = surface.side(v, false).origin;
    const glm::dvec3 across = glm::normalize(glm::dvec3(1 - p.y, p.x, 0));  // free side of the great circle
    for (uint32_t c = 0; c < bench.grid.size(); ++c) {
      const glm::dvec3 wo(bench.grid.direction(c));
      if (wo.y < 0.3) continue;
      const double angle = std::asin(glm::dot(across, glm::dvec3(-wo.x, wo.y, -wo.z)));
      const double expected = 0.5 * std::erfc(-angle * std::sqrt(kSharp / 2.0));
      if (expected < 0.001 || expected > 0.999) continue;
      square += (free[c] - expected) * (free[c] - expected);
      ++cut;
    }
  }
  EXPECT_GT(cut, 200);
  return std::sqrt(square / cut);
}

TEST(OwnRaysTest, EdgesCutSharpLobesWhereTheyAre) {
  const Bench bench(FloorUnderEdge());
  const double shared = ErrorAtEdge(bench, WithOwnRays(0)), own = ErrorAtEdge(bench, WithOwnRays(32));
  EXPECT_LT(own, 0.03);
  EXPECT_GT(shared, 3 * own);
}

TEST(OwnRaysTest, MirrorsShowMirrorsAsSharpAsTheyAre) {
  const Bench bench(FacingMirrors(), 2);
  const auto kappa_of = [&](int own_rays) {
    const auto layers = GatherLayers(bench.input, WithOwnRays(own_rays), 2);
    double sum = 0;
    int count = 0;
    for (uint32_t v = 0; v < bench.domain.vertex_count(); ++v) {
      for (uint32_t c = 0; c < bench.grid.size(); ++c) {
        const float cosine = glm::dot(bench.domain.normals[v], bench.grid.direction(c));
        const std::byte* entry = layers[1]->views.table(0, 0).Find(v, c);
        if (!entry || cosine < 0.3f) continue;
        if (DecodeIndirect(entry).alpha.x < 0.99f * cosine) continue;  // an edge is in the way
        sum += DecodeIndirect(entry).kappa;
        ++count;
      }
    }
    EXPECT_GT(count, 100);
    return sum / count;
  };
  // Two reflections of kSharp each; the shared rays make the first as broad as 0.6 of 4096 cells resolve.
  EXPECT_NEAR(kappa_of(32), kSharp / 2, 0.05 * kSharp);
  EXPECT_LT(kappa_of(0), 6000);
}

TEST(OwnRaysTest, NoneWhereNothingIsInTheWay) {
  const Bench bench(Generated("sphere", kSharp));
  const BlockResult own = bench.Gather(WithOwnRays(32));
  for (const BlockRows& rows : own.slots) EXPECT_TRUE(rows.columns.empty());
  ExpectSame(own, bench.Gather(WithOwnRays(0)));
}

TEST(OwnRaysTest, NoneForLobesThatTheSharedRaysResolve) {
  const Bench bench(Generated("teapot", 512), 2);
  const auto own = GatherLayers(bench.input, WithOwnRays(32), 2);
  const auto shared = GatherLayers(bench.input, WithOwnRays(0), 2);
  for (size_t layer = 0; layer < own.size(); ++layer) EXPECT_TRUE(own[layer]->bytes == shared[layer]->bytes);
}

TEST(OwnRaysTest, AnyPartitionGivesTheSameSlices) {
  for (const bool nested : {false, true}) {
    const Bench bench(FloorUnderEdge(true), 2, nested ? 0 : 2);
    BakeSettings settings = WithOwnRays(32);
    settings.slice_lobes = 2;
    settings.angular_tolerance = 0.1f;
    const uint32_t half = bench.grid.size() / 2;
    for (const uint32_t v : {0u, 40u, 44u, 83u}) {
      const BlockResult whole = bench.Gather(settings, {v, 1, 0, bench.grid.size()});
      BlockResult joined = bench.Gather(settings, {v, 1, 0, half});
      const BlockResult right = bench.Gather(settings, {v, 1, half, bench.grid.size() - half});
      for (size_t slot = 0; slot < joined.slots.size(); ++slot) {
        BlockRows &to = joined.slots[slot], from = right.slots[slot];
        if (to.counts.empty() || from.counts.empty()) continue;
        to.counts[0] = static_cast<uint16_t>(to.counts[0] + from.counts[0]);
        to.columns.insert(to.columns.end(), from.columns.begin(), from.columns.end());
        to.entries.insert(to.entries.end(), from.entries.begin(), from.entries.end());
      }
      joined.counters += right.counters;
      ExpectSame(joined, whole);
    }
  }
}

}  // namespace
}  // namespace glint
