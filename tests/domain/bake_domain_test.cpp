#include "common/domain/bake_domain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/scene/generate.h"

namespace glint {
namespace {

TEST(BakeDomain, OneShapePerDistinctReflectance) {
  const Result<Scene> scene = GenerateScene("goblets", {3000, 0});
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  const BakeDomain domain = BuildBakeDomain(*scene, {.max_lobes = 1}, 1);
  ASSERT_EQ(domain.vertex_count(), scene->positions.size());
  EXPECT_LE(domain.shapes.size(), scene->materials.size());
  for (uint32_t v = 0; v < domain.vertex_count(); ++v) {
    const Brdf exact = ToBrdf(EvaluateVertexMaterial(*scene, v)), stored = domain.BrdfOf(domain.Node(v));
    ASSERT_EQ(stored.model, exact.model);
    ASSERT_EQ(stored.shape, exact.shape);
    ASSERT_EQ(stored.specular, exact.specular);
    ASSERT_EQ(stored.diffuse, exact.diffuse);
  }
}

TEST(BakeDomain, PhongExponentBecomesTheShape) {
  const Result<Scene> scene = GenerateScene("sphere", {500, 64});
  ASSERT_TRUE(scene.ok());
  const BakeDomain domain = BuildBakeDomain(*scene, {}, 1);
  ASSERT_EQ(domain.shapes.size(), 1u);
  EXPECT_EQ(domain.shapes[0].model, BrdfModel::kPhong);
  EXPECT_EQ(domain.shapes[0].shape, 64);
}

/// A small sphere of which every vertex has a material of its own.
Scene ManyMaterials(const std::vector<Material>& materials) {
  Scene scene = GenerateScene("sphere", {500, 0}).value();
  scene.materials = materials;
  for (size_t v = 0; v < scene.vertex_material.size(); ++v)
    scene.vertex_material[v] = static_cast<uint16_t>(v % materials.size());
  return scene;
}

TEST(BakeDomain, ManyDifferentShapesAreRounded) {
  std::vector<Material> materials(kMaxExactShapes);
  for (size_t i = 0; i < materials.size(); ++i)
    materials[i].roughness = 0.2f + 0.001f * static_cast<float>(i);
  Material phong;
  phong.model = MaterialModel::kPhong;
  phong.exponent = 1000;
  materials.push_back(phong);
  const Scene scene = ManyMaterials(materials);
  ASSERT_GT(scene.positions.size(), materials.size());
  const BakeDomain domain = BuildBakeDomain(scene, {.max_lobes = 1}, 1);
  EXPECT_LE(domain.shapes.size(), 20u);
  ASSERT_EQ(domain.notes.size(), 1u);
  EXPECT_NE(domain.notes[0].find("257 different roughnesses"), std::string::npos) << domain.notes[0];
  for (uint32_t v = 0; v < domain.vertex_count(); ++v) {
    const Material& material = materials[scene.vertex_material[v]];
    const BrdfShape& shape = domain.shapes[domain.shape[v]];
    if (material.model == MaterialModel::kPhong) {
      ASSERT_EQ(shape.model, BrdfModel::kPhong);
      ASSERT_NEAR(std::pow(2 / (shape.shape + 2), 0.25f), std::pow(2.0f / 1002, 0.25f), kRoughnessStep / 2);
    } else {
      ASSERT_NEAR(shape.shape, material.roughness, 0.5001f * kRoughnessStep);
    }
  }
}

TEST(ToBrdf, MetallicRoughnessFollowsTheSpecification) {
  SurfacePoint point;
  point.base_color = {0.5f, 0.25f, 0.125f};
  point.metallic = 0.5f;
  point.roughness = 0;
  const Brdf brdf = ToBrdf(point);
  EXPECT_FLOAT_EQ(brdf.specular.x, 0.27f);
  EXPECT_FLOAT_EQ(brdf.diffuse.y, 0.125f);
  EXPECT_FLOAT_EQ(brdf.shape, kMinRoughness);
}

}  // namespace
}  // namespace glint
