#include "common/scene/generate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <set>

#include "common/scene/normals.h"
#include "common/scene/ray_scene.h"

namespace glint {
namespace {

TEST(GenerateTest, EveryScene) {
  for (const GeneratedScene& entry : GeneratedScenes()) {
    const auto scene = GenerateScene(entry.name);
    ASSERT_TRUE(scene.ok());
    EXPECT_NEAR(scene->positions.size(), 25000, 1000) << entry.name;
    EXPECT_NEAR(double(scene->triangles.size()) / scene->positions.size(), 2, 0.1) << entry.name;
    EXPECT_EQ(scene->content, HashScene(*scene));
    ASSERT_EQ(scene->cameras.size(), 1u);
    EXPECT_EQ(scene->cameras[0].name, "main");
    std::set<std::array<float, 3>> places;
    for (const glm::vec3& p : scene->positions) places.insert({p.x, p.y, p.z});
    // The box's faces have normals, and so vertices, of their own along its edges.
    if (entry.name != "furnace") {
      EXPECT_EQ(places.size(), scene->positions.size()) << entry.name << ": not welded";
    }
    for (uint32_t i = 0; i < scene->positions.size(); ++i) {
      ASSERT_NEAR(glm::length(scene->normals[i]), 1, 1e-5f);
    }
    for (const auto& [a, b, c] : scene->triangles) {
      const glm::vec3 face =
          glm::cross(scene->positions[b] - scene->positions[a], scene->positions[c] - scene->positions[a]);
      ASSERT_GT(glm::length(face), 0) << entry.name;
      for (const uint32_t i : {a, b, c}) ASSERT_GT(glm::dot(face, scene->normals[i]), 0) << entry.name;
    }
    // The camera sees something in the middle, and its front.
    const RayScene rays(*scene);
    Ray ray;
    ray.origin = scene->cameras[0].eye;
    ray.direction = scene->cameras[0].forward;
    if (entry.name == "planes") continue;  // it looks between them
    const Hit hit = rays.Intersect(ray);
    ASSERT_TRUE(hit.hit()) << entry.name;
    const uint32_t seen = scene->triangles[hit.triangle][0];
    EXPECT_LT(glm::dot(scene->normals[seen], ray.direction), 0.3f) << entry.name;
  }
}

TEST(GenerateTest, SolidsAreClosed) {
  for (const char* name : {"sphere", "blob", "goblets", "knot"}) {
    GenerateOptions options;
    options.vertices = 3000;
    const auto scene = GenerateScene(name, options);
    ASSERT_TRUE(scene.ok());
    // Each edge of a solid's triangles is met once in each direction; planes (the floor) are open.
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    for (size_t t = 0; t < scene->triangles.size(); ++t) {
      const std::string& material = scene->materials[scene->triangle_material[t]].name;
      if (material.find("plane") != std::string::npos) continue;
      const auto& triangle = scene->triangles[t];
      for (int k = 0; k < 3; ++k) ++edges[{triangle[k], triangle[(k + 1) % 3]}];
    }
    EXPECT_FALSE(edges.empty());
    for (const auto& [edge, count] : edges) {
      ASSERT_EQ(count, 1) << name;
      ASSERT_TRUE(edges.contains({edge.second, edge.first})) << name;
    }
  }
}

TEST(GenerateTest, VertexCountIsMet) {
  for (const uint32_t wanted : {3000u, 60000u}) {
    GenerateOptions options;
    options.vertices = wanted;
    for (const char* name : {"teapot", "goblets", "knot"}) {
      const auto scene = GenerateScene(name, options);
      ASSERT_TRUE(scene.ok());
      EXPECT_NEAR(double(scene->positions.size()) / wanted, 1, 0.06) << name << " " << wanted;
    }
  }
}

TEST(GenerateTest, ExponentMakesPhong) {
  GenerateOptions options;
  options.vertices = 2000;
  options.exponent = 128;
  const auto scene = GenerateScene("goblets", options);
  ASSERT_TRUE(scene.ok());
  for (const Material& material : scene->materials) {
    EXPECT_EQ(material.model, MaterialModel::kPhong);
    EXPECT_EQ(material.exponent, 128);
    EXPECT_GT(material.specular.r, 0.5f);
    EXPECT_EQ(material.diffuse, glm::vec3(0));
  }
}

TEST(GenerateTest, RefusesUnknownNamesAndSizes) {
  EXPECT_EQ(GenerateScene("teacup").status().kind(), ErrorKind::kUsage);
  GenerateOptions options;
  options.vertices = 1;
  EXPECT_EQ(GenerateScene("teapot", options).status().kind(), ErrorKind::kUsage);
}

TEST(NormalsTest, WeightsByAngleNotByTriangles) {
  // A cube's corner: one face as two triangles, two as one each. The normal is the diagonal all the same.
  const std::vector<glm::vec3> p = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<std::array<uint32_t, 3>> t = {{0, 1, 2}, {0, 2, 3}, {0, 4, 1}, {0, 3, 4}};
  const auto normals = AngleWeightedNormals(p, t);
  EXPECT_LT(glm::distance(normals[0], glm::normalize(glm::vec3(1, 1, 1))), 1e-6f);
}

}  // namespace
}  // namespace glint
