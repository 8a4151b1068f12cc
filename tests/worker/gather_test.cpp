#include "worker/gather.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <memory>

#include "common/archive/lobe_codec.h"
#include "common/base/frame.h"
#include "common/lobes/vmf.h"
#include "common/scene/generate.h"
#include "tests/worker/gathered_layer.h"
#include "worker/slice_lobes.h"

namespace glint {
namespace {

/// A scene ready to be gathered.
struct Bench {
  Scene scene;
  BakeDomain domain;
  DirectionGrid grid;
  RayScene rays;
  GatherInput input;

  explicit Bench(Scene s, int level = 2)
      : scene(std::move(s)),
        domain(BuildBakeDomain(scene, {}, 1)),
        grid(level),
        rays(scene, 1),
        input{domain, rays, grid} {}

  BlockResult Gather(const BakeSettings& settings, int layer = 0,
                     const LayerViews* previous = nullptr) const {
    const std::unique_ptr<Gatherer> gatherer = MakeGatherer(input, settings, uint64_t{1} << 30);
    gatherer->BeginLayer(layer, previous, 1);
    return gatherer->Gather({0, domain.vertex_count(), 0, grid.size()});
  }
};

Scene Generated(const char* name, uint32_t vertices, float exponent) {
  Result<Scene> scene = GenerateScene(name, {vertices, exponent});
  EXPECT_TRUE(scene.ok());
  return *scene;
}

/// A square floor, facing +y, with `quads` quads a side, and a wall along its -x border whose foot shares
/// positions with the floor's border.
Scene FloorAndWall(bool double_sided) {
  constexpr int kQuads = 8;
  Scene scene;
  Material material;
  material.model = MaterialModel::kPhong;
  material.exponent = 32;
  material.specular = glm::vec3(0.5f);
  material.double_sided = double_sided;
  scene.materials = {material};
  auto add_quads = [&](const glm::vec3& origin, const glm::vec3& u, const glm::vec3& v) {
    const auto base = static_cast<uint32_t>(scene.positions.size());
    for (int j = 0; j <= kQuads; ++j)
      for (int i = 0; i <= kQuads; ++i) {
        scene.positions.push_back(origin + u * (float(i) / kQuads) + v * (float(j) / kQuads));
        scene.normals.push_back(glm::normalize(glm::cross(u, v)));
      }
    for (uint32_t j = 0; j < kQuads; ++j)
      for (uint32_t i = 0; i < kQuads; ++i) {
        const uint32_t a = base + j * (kQuads + 1) + i, b = a + 1, c = a + kQuads + 1, d = c + 1;
        scene.triangles.push_back({a, b, d});
        scene.triangles.push_back({a, d, c});
      }
  };
  add_quads({-1, 0, 1}, {2, 0, 0}, {0, 0, -2});
  add_quads({-1, 0, 1}, {0, 0, -2}, {0, 2, 0});
  scene.triangle_material.assign(scene.triangles.size(), 0);
  scene.vertex_material.assign(scene.positions.size(), 0);
  scene.uvs.assign(scene.positions.size(), glm::vec2(0));
  scene.colors.assign(scene.positions.size(), glm::vec4(1));
  scene.content = HashScene(scene);
  return scene;
}

class GatherMethodTest : public testing::TestWithParam<GatherMethod> {
 protected:
  BakeSettings Settings() const {
    BakeSettings settings;
    settings.method = GetParam();
    settings.grid_level = 2;
    return settings;
  }
};

TEST_P(GatherMethodTest, ASphereAloneStoresNothing) {
  const Bench bench(Generated("sphere", 600, 32));
  const BlockResult result = bench.Gather(Settings());
  for (const BlockRows& rows : result.slots) EXPECT_TRUE(rows.columns.empty());
  EXPECT_GT(result.counters.slices, 0u);
}

TEST_P(GatherMethodTest, AnyPartitionGivesTheSameSlices) {
  const Bench bench(Generated("teapot", 800, 32));
  const BakeSettings settings = Settings();
  const BlockResult whole = bench.Gather(settings);
  const auto gatherer = MakeGatherer(bench.input, settings, 0);  // no room: every hit set is traced again
  gatherer->BeginLayer(0, nullptr, 1);
  const uint32_t half = bench.grid.size() / 2;
  size_t row_entry = 0;
  for (uint32_t v = 0; v < 60; ++v) {
    const BlockResult left = gatherer->Gather({v, 1, 0, half});
    const BlockResult right = gatherer->Gather({v, 1, half, bench.grid.size() - half});
    std::vector<uint16_t> columns = left.slots[0].columns;
    columns.insert(columns.end(), right.slots[0].columns.begin(), right.slots[0].columns.end());
    std::vector<std::byte> entries = left.slots[0].entries;
    entries.insert(entries.end(), right.slots[0].entries.begin(), right.slots[0].entries.end());
    ASSERT_EQ(columns.size(), whole.slots[0].counts[v]);
    for (size_t i = 0; i < columns.size(); ++i) ASSERT_EQ(columns[i], whole.slots[0].columns[row_entry + i]);
    ASSERT_TRUE(
        std::equal(entries.begin(), entries.end(),
                   whole.slots[0].entries.begin() + static_cast<ptrdiff_t>(row_entry * kDirectEntryBytes)));
    row_entry += columns.size();
  }
}

TEST_P(GatherMethodTest, NoLightLeaksThroughTheFootOfAWall) {
  const Bench bench(FloorAndWall(false));
  const BlockResult result = bench.Gather(Settings());
  // Seen from +x the floor's lobes point to the wall: also those of the vertices that lie on the wall itself.
  const BlockRows& rows = result.slots[0];
  size_t entry = 0;
  int checked = 0;
  for (uint32_t v = 0; v < bench.domain.vertex_count(); ++v) {
    const glm::vec3& p = bench.domain.positions[v];
    const bool foot = bench.domain.normals[v].y > 0.5f && p.x == -1 && std::abs(p.z) < 0.6f;
    for (uint16_t i = 0; i < rows.counts[v]; ++i, ++entry) {
      const glm::vec3& wo = bench.grid.direction(rows.columns[entry]);
      if (!foot || wo.x < 0.6f || wo.y < 0.3f || std::abs(wo.z) > 0.2f) continue;
      EXPECT_LT(DecodeDirect(rows.entries.data() + entry * kDirectEntryBytes).fraction, 0.05f);
      ++checked;
    }
  }
  EXPECT_GT(checked, 0);
}

TEST_P(GatherMethodTest, DoubleSidedSurfacesHaveSlicesOnBothSides) {
  const Bench single(FloorAndWall(false)), both(FloorAndWall(true));
  const BlockResult one = single.Gather(Settings()), two = both.Gather(Settings());
  EXPECT_NEAR(static_cast<double>(two.counters.slices), 2.0 * static_cast<double>(one.counters.slices),
              0.1 * static_cast<double>(two.counters.slices));
}

INSTANTIATE_TEST_SUITE_P(Methods, GatherMethodTest,
                         testing::Values(GatherMethod::kShared, GatherMethod::kPaper));

TEST(SharedGather, AgreesWithManyRaysOfThePaper) {
  const Bench bench(FloorAndWall(false));
  BakeSettings shared, truth;
  shared.grid_level = truth.grid_level = 2;
  truth.method = GatherMethod::kPaper;
  truth.paper_rays = 4096;
  truth.drop = shared.drop = 0;
  const BlockResult a = bench.Gather(shared), b = bench.Gather(truth);
  ASSERT_EQ(a.slots[0].counts.size(), b.slots[0].counts.size());
  double error = 0;
  int count = 0;
  size_t ia = 0, ib = 0;
  for (uint32_t v = 0; v < bench.domain.vertex_count(); ++v) {
    std::vector<float> fraction_a(bench.grid.size(), 1), fraction_b(bench.grid.size(), 1);
    for (uint16_t i = 0; i < a.slots[0].counts[v]; ++i, ++ia)
      fraction_a[a.slots[0].columns[ia]] =
          DecodeDirect(a.slots[0].entries.data() + ia * kDirectEntryBytes).fraction;
    for (uint16_t i = 0; i < b.slots[0].counts[v]; ++i, ++ib)
      fraction_b[b.slots[0].columns[ib]] =
          DecodeDirect(b.slots[0].entries.data() + ib * kDirectEntryBytes).fraction;
    for (uint32_t c = 0; c < bench.grid.size(); ++c) {
      error += std::pow(fraction_a[c] - fraction_b[c], 2);
      ++count;
    }
  }
  // 4096 random rays carry 0.008 themselves.
  EXPECT_LT(std::sqrt(error / count), 0.012);
}

/// A broad floor between two mirror-like walls, red at -x and blue at +x.
Scene FloorBetweenColouredWalls() {
  Scene scene = FloorAndWall(false);
  const auto floor_vertices = static_cast<uint32_t>(scene.positions.size() / 2);
  const size_t floor_triangles = scene.triangles.size() / 2;
  Material wall = scene.materials[0];
  wall.exponent = 300;
  wall.specular = {0.3f, 0.01f, 0.01f};  // as luminous as the blue
  scene.materials[0].exponent = 5;
  scene.materials.push_back(wall);
  wall.specular = {0.01f, 0.01f, 0.9f};
  scene.materials.push_back(wall);
  // The other wall is the first one, mirrored.
  for (uint32_t v = 0; v < floor_vertices; ++v) {
    const glm::vec3 p = scene.positions[floor_vertices + v];
    scene.positions.push_back({-p.x, p.y, p.z});
    scene.normals.push_back({-1, 0, 0});
  }
  for (size_t t = 0; t < floor_triangles; ++t) {
    const auto [a, b, c] = scene.triangles[floor_triangles + t];
    scene.triangles.push_back({a + floor_vertices, c + floor_vertices, b + floor_vertices});
  }
  scene.triangle_material.clear();
  scene.vertex_material.clear();
  for (uint32_t m = 0; m < 3; ++m) {
    scene.triangle_material.insert(scene.triangle_material.end(), floor_triangles, m);
    scene.vertex_material.insert(scene.vertex_material.end(), floor_vertices, m);
  }
  scene.uvs.assign(scene.positions.size(), glm::vec2(0));
  scene.colors.assign(scene.positions.size(), glm::vec4(1));
  scene.content = HashScene(scene);
  return scene;
}

TEST(SharedGather, TwoFacingColouredLightsAreTwoLobes) {
  const Bench bench(FloorBetweenColouredWalls());
  BakeSettings settings;
  settings.grid_level = 2;
  settings.slice_lobes = kMaxSliceLobes;
  settings.lobe_tolerance = 0.005f;  // the walls are a small part of a broad lobe
  const auto layers = GatherLayers(bench.input, settings, 2);
  settings.slice_lobes = 1;
  const auto single = GatherLayers(bench.input, settings, 2);
  const LayerViews &views = layers[1]->views, &one = single[1]->views;
  const auto read = [](const SliceTableView& table, uint32_t v, uint32_t column) {
    const std::byte* entry = table.Find(v, column);
    return entry ? DecodeIndirect(entry) : IndirectLobe{};
  };
  int slices = 0;
  for (uint32_t v = 0; v < bench.domain.vertex_count(); ++v) {
    const glm::vec3& p = bench.domain.positions[v];
    if (bench.domain.normals[v].y < 0.5f || std::abs(p.x) > 0.3f || std::abs(p.z) > 0.6f) continue;
    for (uint32_t column = 0; column < bench.grid.size(); ++column) {
      if (bench.grid.direction(column).y < 0.97f) continue;
      ++slices;
      // Seen from above, each wall's light goes on to the other side, and stays what colour it is.
      float red = 0, blue = 0;
      glm::vec3 alpha(0);
      for (uint32_t i = 0; i < views.lobes(); ++i) {
        const IndirectLobe lobe = read(views.table(i, 0), v, column);
        alpha += lobe.alpha;
        if (lobe.mu.x > 0.2f) {
          red += lobe.alpha.x;
          EXPECT_LT(lobe.alpha.z, 0.3f * lobe.alpha.x);
        } else if (lobe.mu.x < -0.2f) {
          blue += lobe.alpha.z;
          EXPECT_LT(lobe.alpha.x, 0.3f * lobe.alpha.z);
        }
      }
      EXPECT_GT(red, 0.85f * alpha.x);
      EXPECT_GT(blue, 0.85f * alpha.z);
      // One lobe for both is as bright and looks at neither.
      const IndirectLobe both = read(one.table(0, 0), v, column);
      EXPECT_LT(glm::distance(alpha, both.alpha), 2e-3f * glm::length(alpha));
    }
  }
  EXPECT_GT(slices, 10);
}

}  // namespace
}  // namespace glint
