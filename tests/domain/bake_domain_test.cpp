#include "common/domain/bake_domain.h"

#include <gtest/gtest.h>

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
    const Brdf exact = ToBrdf(EvaluateVertexMaterial(*scene, v)), stored = domain.VertexBrdf(v);
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
