// Refined bakes: what is chosen depends on scene and settings alone, and buys what it costs.
#include "coordinator/spatial/refine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/archive/archive.h"
#include "common/scene/mesh_builder.h"
#include "coordinator/spatial/predictions.h"
#include "coordinator/spatial/vertex_hierarchy.h"
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

BakeOptions Refined(float tolerance) {
  BakeOptions options = SmallOptions();
  options.max_layers = 1;
  options.settings.spatial_tolerance = tolerance;
  options.settings.smallest_edge = 1.0f / 32;
  return options;
}

TEST(RefineTest, FewVerticesWhereNothingHappensAndManyWhereItDoes) {
  const Scene scene = BallOnFloor();
  const auto all = BakeHere(scene, SmallOptions()), refined = BakeHere(scene, Refined(0.1f));
  ASSERT_TRUE(all->archive && refined->archive);
  const BakeDomain& domain = refined->archive->domain();
  uint32_t ball = 0;
  float near_floor = 0, far_floor = 0;  // per area
  for (uint32_t r = 0; r < domain.row_count(); ++r) {
    const glm::vec3 p = domain.NodePosition(domain.RowNode(r));
    const bool floor = p.y < -1.05f;
    const float distance = std::hypot(p.x, p.z);
    ball += !floor;
    near_floor += floor && distance < 2 ? 1 / (3.1416f * 4) : 0;
    far_floor += floor && distance > 3 ? 1 / (64 - 3.1416f * 9) : 0;
  }
  EXPECT_LT(ball, all->report.vertices / 2) << "a ball's own slices are all the same";
  EXPECT_GT(near_floor, 1);
  EXPECT_GT(near_floor, 1.25f * far_floor);
}

TEST(RefineTest, ToleranceBuysError) {
  const Scene scene = BallOnFloor();
  BakeOptions coarse = Refined(0.3f), fine = Refined(0.05f);
  coarse.estimate_slices = fine.estimate_slices = 400;
  const auto few = BakeHere(scene, coarse), many = BakeHere(scene, fine);
  EXPECT_GT(many->report.baked_vertices, few->report.baked_vertices);
  EXPECT_LT(many->report.error->all.rms, few->report.error->all.rms);
}

/// A floor beside a wall that it mirrors, bent up to a height of `bend` towards both of its ends.
Scene FloorBesideWall(float bend) {
  MeshBuilder builder;
  Material metal;
  metal.metallic = 1;
  metal.roughness = 0.3f;
  const uint16_t mirror = builder.AddMaterial(metal);
  builder.AddPatch({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 24, 24, mirror);
  const uint32_t floor = builder.vertex_count();
  builder.AddPatch({-1, -0.5, -1.5}, {2, 0, 0}, {0, 3, 0}, 2, 2, mirror);
  Scene scene = builder.Finish({});
  for (uint32_t v = 0; v < floor; ++v) {
    const float x = scene.positions[v].x;
    scene.positions[v].y = bend * x * x;
    scene.normals[v] = glm::normalize(glm::vec3(-2 * bend * x, 1, 0));
  }
  scene.content = HashScene(scene);
  return scene;
}

TEST(RefineTest, WhereTheSurfaceTurnsItTakesMoreVerticesForWhatItReflects) {
  const auto rows = [](float bend) {
    BakeDomain domain = BuildBakeDomain(FloorBesideWall(bend), BrdfFitOptions{}, 1);
    EXPECT_TRUE(RefineVertices(Refined(0.1f).settings, 1, &domain).ok());
    uint32_t middle = 0;
    for (const uint32_t node : domain.nodes.rows) middle += std::abs(domain.NodePosition(node).z) < 0.7f;
    return middle;
  };
  EXPECT_GT(rows(0.2f), 2 * rows(0));
}

TEST(RefineTest, AtMostSoManyVertices) {
  BakeOptions options = Refined(0.02f);
  const auto free = BakeHere(BallOnFloor(), options);
  options.settings.max_vertices = 150;
  const auto bounded = BakeHere(BallOnFloor(), options);
  EXPECT_GT(free->report.baked_vertices, 150u);
  EXPECT_LE(bounded->report.baked_vertices, 150u);
}

TEST(RefineTest, EvenSubdivisionHalvesEveryEdge) {
  BakeOptions options = SmallOptions();
  options.settings.subdivide = 1;
  const Scene scene = Generated("planes", 500);
  const auto baked = BakeHere(scene, options);
  // Each face gives four; nodes are vertices and edges, counted by Euler's formula for two sheets.
  const size_t vertices = scene.positions.size(), faces = scene.triangles.size();
  EXPECT_EQ(baked->report.baked_vertices, vertices + (vertices + faces - 2));
  options.settings.spatial_tolerance = 0.1f;
  const TempFolder folder;
  EXPECT_EQ(BakeScene(scene, "scene", folder / "out.glint", options).status().kind(), ErrorKind::kUsage);
}

TEST(RefineTest, TheSurfaceStaysAsItIs) {
  const Scene scene = BallOnFloor();
  BakeOptions options = Refined(0);
  const auto plain = BakeHere(scene, options);
  options.settings.spatial_tolerance = 0.1f;
  const auto refined = BakeHere(scene, options);
  const auto &a = plain->archive, &b = refined->archive;
  ASSERT_TRUE(a && b);
  EXPECT_FALSE(b->domain().nodes.every_vertex());
  EXPECT_EQ(a->domain().positions, b->domain().positions);
  EXPECT_EQ(a->domain().normals, b->domain().normals);
  EXPECT_EQ(a->domain().triangles, b->domain().triangles);
  EXPECT_EQ(a->domain().specular, b->domain().specular);
}

TEST(RefineTest, SurvivesBrokenSurfaces) {
  Scene scene = GeneratedPaint("planes", 500);
  const auto first = scene.triangles[0];
  scene.triangles.push_back(first);                           // twice
  scene.triangles.push_back({first[1], first[0], first[2]});  // and inside out
  scene.triangles.push_back({first[0], first[0], first[2]});  // and without area
  scene.triangle_material.insert(scene.triangle_material.end(), 3, 0);
  scene.content = HashScene(scene);
  const auto baked = BakeHere(scene, Refined(0.1f));
  ASSERT_TRUE(baked->archive);
  EXPECT_EQ(baked->report.refinement->non_manifold, 2u);
  EXPECT_EQ(baked->report.refinement->degenerate, 1u);
  EXPECT_GE(baked->report.notes.size(), 2u);
  const BakeDomain& domain = baked->archive->domain();
  const std::vector<uint32_t> welded = WeldVertices(domain);
  for (const uint32_t v : first)
    EXPECT_EQ(std::count(domain.nodes.rows.begin(), domain.nodes.rows.end(), welded[v]), 1)
        << "a broken face's corner is not baked";
}

TEST(VertexHierarchyTest, ParentsAreCoarserAndAround) {
  const Scene scene = Generated("blob", 2000);
  const BakeDomain domain = BuildBakeDomain(scene, BrdfFitOptions{}, 1);
  const VertexHierarchy hierarchy = BuildHierarchy(domain);
  EXPECT_GT(hierarchy.levels, 4);
  size_t coarsest = 0;
  for (uint32_t v = 0; v < domain.vertex_count(); ++v) {
    if (hierarchy.welded[v] != v) continue;
    coarsest += hierarchy.level[v] == 0;
    if (hierarchy.level[v] == 0) continue;
    ASSERT_FALSE(hierarchy.parents[v].empty());
    float sum = 0;
    glm::vec3 predicted(0);
    float reach = 0;
    for (const Parent& p : hierarchy.parents[v]) {
      EXPECT_LT(hierarchy.level[p.node], hierarchy.level[v]);
      EXPECT_GT(p.weight, 0);
      sum += p.weight;
      predicted += p.weight * domain.positions[p.node];
      reach = std::max(reach, glm::distance(domain.positions[p.node], domain.positions[v]));
    }
    EXPECT_NEAR(sum, 1, 1e-5f);
    EXPECT_LT(glm::distance(predicted, domain.positions[v]), 0.75f * reach);
  }
  EXPECT_LT(coarsest, domain.vertex_count() / 10);
}

TEST(PredictionsTest, TheDarkHaveNoSayBesideOthers) {
  Predictions predictions;
  predictions.Resize(4);
  predictions.Bake(0, true);
  predictions.Bake(1, false);
  const Parent both[] = {{0, 0.5f}, {1, 0.5f}};
  predictions.Predict(2, both);
  ASSERT_EQ(predictions.Of(2).size(), 1u);
  EXPECT_EQ(predictions.Of(2)[0].node, 1u);
  EXPECT_EQ(predictions.Of(2)[0].weight, 1);
  const Parent dark[] = {{0, 1.0f}};
  predictions.Predict(3, dark);
  EXPECT_EQ(predictions.Of(3)[0].node, 0u);
}

}  // namespace
}  // namespace glint
