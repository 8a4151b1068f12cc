#include "common/scene/load.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "common/scene/generate.h"
#include "tests/scene/gltf_samples.h"

namespace glint {
namespace {

using nlohmann::json;
using test::Bytes;

Result<Scene> Load(const json& document, const Bytes& binary) {
  return LoadSceneFromMemory(test::MakeGlb(document, binary), "test.glb");
}

struct Sample {
  Bytes binary;
  json document = test::QuadDocument(binary);
  Result<Scene> Load() const { return glint::Load(document, binary); }
  json& primitive() { return document["meshes"][0]["primitives"][0]; }
};

// The scene is refused, and the message names the file and `object`.
void ExpectRefused(const Result<Scene>& scene, const std::string& object,
                   ErrorKind kind = ErrorKind::kBadInput) {
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(scene.status().kind(), kind) << scene.status().message();
  EXPECT_EQ(scene.status().message().rfind("test.glb: ", 0), 0u) << scene.status().message();
  EXPECT_NE(scene.status().message().find(object), std::string::npos) << scene.status().message();
}

TEST(LoadTest, ReadsQuad) {
  const auto scene = Sample().Load();
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->positions.size(), 4u);
  EXPECT_EQ(scene->triangles.size(), 2u);
  EXPECT_EQ(scene->positions[2], glm::vec3(1, 1, 0));
  EXPECT_EQ(scene->normals[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(scene->uvs[1], glm::vec2(1, 1));
  EXPECT_FLOAT_EQ(scene->materials[0].roughness, 0.5f);
  ASSERT_EQ(scene->cameras.size(), 1u);
  EXPECT_EQ(scene->cameras[0].name, "main");
  EXPECT_EQ(scene->cameras[0].eye, glm::vec3(0, 0, 3));
  EXPECT_EQ(scene->cameras[0].forward, glm::vec3(0, 0, -1));
  EXPECT_TRUE(scene->notes.empty());
}

TEST(LoadTest, SavedScenesReadBackToTheSameHash) {
  const auto path = std::filesystem::path(testing::TempDir()) / "glint_save_test.glb";
  for (const float exponent : {0.0f, 128.0f}) {
    GenerateOptions options;
    options.vertices = 2000;
    options.exponent = exponent;
    for (const GeneratedScene& entry : GeneratedScenes()) {
      const auto scene = GenerateScene(entry.name, options);
      ASSERT_TRUE(scene.ok());
      ASSERT_TRUE(SaveScene(*scene, path).ok());
      const auto loaded = LoadScene(path);
      ASSERT_TRUE(loaded.ok()) << loaded.status().message();
      EXPECT_EQ(loaded->content, scene->content) << entry.name;
      ASSERT_EQ(loaded->cameras.size(), 1u);
      EXPECT_NEAR(glm::distance(loaded->cameras[0].forward, scene->cameras[0].forward), 0, 1e-6f);
      EXPECT_EQ(loaded->cameras[0].vertical_fov, scene->cameras[0].vertical_fov);
    }
  }
  std::filesystem::remove(path);
}

TEST(LoadTest, AppliesTransformsAndInstances) {
  Sample sample;
  const double h = std::sqrt(0.5);
  // A parent that moves; below it the quad stretched, the quad turned about x by 90 degrees, and a mirrored
  // one.
  sample.document["nodes"] = {{{"translation", {10, 0, 0}}, {"children", {1, 2, 3}}},
                              {{"mesh", 0}, {"scale", {2, 1, 1}}},
                              {{"mesh", 0}, {"rotation", {h, 0, 0, h}}},
                              {{"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1}}}};
  sample.document["scenes"][0]["nodes"] = {0};
  const auto scene = sample.Load();
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  ASSERT_EQ(scene->positions.size(), 12u);
  EXPECT_EQ(scene->positions[2], glm::vec3(12, 1, 0));
  EXPECT_NEAR(glm::distance(scene->positions[6], glm::vec3(11, 0, 1)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(scene->normals[6], glm::vec3(0, -1, 0)), 0, 1e-6);
  EXPECT_EQ(scene->positions[10], glm::vec3(9, 1, 5));
  // Every face still looks where its normals do, the mirrored one too.
  for (const auto& [a, b, c] : scene->triangles) {
    const glm::vec3 face =
        glm::cross(scene->positions[b] - scene->positions[a], scene->positions[c] - scene->positions[a]);
    EXPECT_GT(glm::dot(face, scene->normals[a]), 0);
  }
}

TEST(LoadTest, NormalsFollowUnequalScales) {
  Sample sample;
  const float s = std::sqrt(0.5f);
  const std::vector<float> tilted = {s, 0, s, s, 0, s, s, 0, s, s, 0, s};
  sample.document["accessors"][2]["bufferView"] = test::AddView(sample.document, sample.binary, tilted);
  sample.document["nodes"][0]["scale"] = {4, 1, 1};
  const auto scene = sample.Load();
  ASSERT_TRUE(scene.ok());
  EXPECT_NEAR(glm::distance(scene->normals[0], glm::normalize(glm::vec3(0.25f, 0, 1))), 0, 1e-6);
}

TEST(LoadTest, StripsFansAndPlainListsGiveTheSameFaces) {
  for (const int mode : {4, 5, 6}) {
    Sample sample;
    const std::vector<uint8_t> order = mode == 4   ? std::vector<uint8_t>{0, 1, 2, 0, 2, 3}
                                       : mode == 5 ? std::vector<uint8_t>{0, 1, 3, 2}
                                                   : std::vector<uint8_t>{0, 1, 2, 3};
    const size_t view = test::AddView(sample.document, sample.binary, order);
    sample.document["accessors"][0] = {
        {"bufferView", view}, {"componentType", 5121}, {"count", order.size()}, {"type", "SCALAR"}};
    sample.primitive()["mode"] = mode;
    const auto scene = sample.Load();
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    ASSERT_EQ(scene->triangles.size(), 2u);
    for (const auto& [a, b, c] : scene->triangles) {
      EXPECT_GT(
          glm::cross(scene->positions[b] - scene->positions[a], scene->positions[c] - scene->positions[a]).z,
          0)
          << mode;
    }
  }
}

TEST(LoadTest, NotIndexedPrimitivesAndMadeNormals) {
  Sample sample;
  const size_t view = test::AddView<float>(sample.document, sample.binary, {0, 0, 0, 1, 0, 0, 0, 0, -1});
  sample.document["accessors"][1] = {
      {"bufferView", view}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}};
  sample.primitive().erase("indices");
  sample.primitive()["attributes"] = {{"POSITION", 1}};
  const auto scene = sample.Load();
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  ASSERT_EQ(scene->normals.size(), 3u);
  for (const glm::vec3& normal : scene->normals) EXPECT_EQ(normal, glm::vec3(0, 1, 0));
  EXPECT_EQ(scene->notes.size(), 1u);
}

TEST(LoadTest, NormalizedIntegersSparseAndColors) {
  Sample sample;
  const size_t colors = test::AddView<uint8_t>(
      sample.document, sample.binary, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 51, 255, 255, 255, 255, 255});
  sample.document["accessors"].push_back({{"bufferView", colors},
                                          {"componentType", 5121},
                                          {"normalized", true},
                                          {"count", 4},
                                          {"type", "VEC4"}});
  sample.primitive()["attributes"]["COLOR_0"] = 4;
  const size_t normals = test::AddView<int8_t>(sample.document, sample.binary,
                                               {0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0});
  sample.document["bufferViews"][normals]["byteStride"] = 4;
  sample.document["accessors"][2] = {
      {"bufferView", normals}, {"componentType", 5120}, {"normalized", true}, {"count", 4}, {"type", "VEC3"}};
  const size_t indices = test::AddView<uint16_t>(sample.document, sample.binary, {2});
  const size_t values = test::AddView<float>(sample.document, sample.binary, {3, 3, 0});
  sample.document["accessors"][1]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
      {"values", {{"bufferView", values}}}};
  const auto scene = sample.Load();
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->positions[2], glm::vec3(3, 3, 0));
  EXPECT_EQ(scene->positions[3], glm::vec3(0, 1, 0));
  EXPECT_EQ(scene->normals[0], glm::vec3(0, 0, 1));
  EXPECT_FLOAT_EQ(scene->colors[2].b, 0.2f);
  EXPECT_FLOAT_EQ(EvaluateVertexMaterial(*scene, 2).base_color.b, 0.2f);
}

TEST(LoadTest, DecodesDraco) {
  const auto scene = LoadSceneFromMemory(test::DracoQuad(), "test.glb");
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->triangles.size(), 2u);
  ASSERT_EQ(scene->positions.size(), 4u);
  for (const glm::vec3& p : scene->positions) {
    EXPECT_NEAR(std::min(std::abs(p.x), std::abs(p.x - 1)), 0, 1e-4);
    EXPECT_NEAR(std::min(std::abs(p.y), std::abs(p.y - 1)), 0, 1e-4);
  }
  for (const glm::vec3& n : scene->normals) EXPECT_NEAR(n.z, 1, 1e-4);
}

TEST(LoadTest, DamagedDracoIsRefusedOrHarmless) {
  const Bytes good = test::DracoQuad();
  const std::string marker = "DRACO";
  const auto at = std::search(good.begin(), good.end(), marker.begin(), marker.end(),
                              [](std::byte a, char b) { return a == static_cast<std::byte>(b); });
  ASSERT_NE(at, good.end());
  for (auto i = at; i != good.end(); ++i) {
    Bytes bad = good;
    bad[i - good.begin()] ^= std::byte{0xFF};
    const auto scene = LoadSceneFromMemory(bad, "test.glb");
    if (!scene.ok()) {
      EXPECT_FALSE(scene.status().message().empty());
    }
  }
}

TEST(LoadTest, TexturesAreBilinearAndDecoded) {
  const auto scene = LoadSceneFromMemory(test::TexturedQuad(), "test.glb");
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  ASSERT_EQ(scene->images.size(), 1u);
  EXPECT_EQ(scene->images[0].width, 4);
  EXPECT_EQ(scene->images[0].height, 2);
  // Vertex 3 has uv (0, 0): the red texel, clamped. Roughness factor 0.5 times green 0; metallic times blue
  // 0.
  const SurfacePoint corner = EvaluateVertexMaterial(*scene, 3);
  EXPECT_EQ(corner.base_color, glm::vec3(1, 0, 0));
  EXPECT_EQ(corner.roughness, 0);
  EXPECT_EQ(corner.metallic, 0);
  // uv (0.25, 0.5) lies between red and green above, black below: a quarter each after decoding.
  const SurfacePoint middle = EvaluateMaterial(*scene, 1, 0.25f, 0.5f);
  const glm::vec2 uv = 0.25f * scene->uvs[0] + 0.25f * scene->uvs[2] + 0.5f * scene->uvs[3];
  EXPECT_EQ(uv, glm::vec2(0.25f, 0.25f));
  EXPECT_NEAR(middle.base_color.r, 0.5f, 1e-6);
  EXPECT_NEAR(middle.base_color.g, 0.5f, 1e-6);
}

TEST(LoadTest, PhongByExtras) {
  Sample sample;
  sample.document["materials"][0]["extras"]["glint_brdf"] = {
      {"model", "blinn-phong"}, {"exponent", 64}, {"specular", {0.5, 0.25, 1}}};
  const auto scene = sample.Load();
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  const SurfacePoint point = EvaluateVertexMaterial(*scene, 0);
  EXPECT_EQ(point.model, MaterialModel::kBlinnPhong);
  EXPECT_EQ(point.exponent, 64);
  EXPECT_EQ(point.specular, glm::vec3(0.5f, 0.25f, 1));
  EXPECT_EQ(point.diffuse, glm::vec3(0));
  sample.document["materials"][0]["extras"]["glint_brdf"]["model"] = "ward";
  ExpectRefused(sample.Load(), "materials[0].extras.glint_brdf.model");
  sample.document["materials"][0]["extras"]["glint_brdf"] = {{"model", "phong"}, {"exponent", -1}};
  ExpectRefused(sample.Load(), "exponent");
}

TEST(LoadTest, MendsAndNotes) {
  Sample sample;
  sample.document["accessors"][2]["bufferView"] =
      test::AddView<float>(sample.document, sample.binary, {0, 0, 2, 0, 0, 0, 0, 0, 1, 0, 0, 1});
  sample.document["accessors"][0]["bufferView"] =
      test::AddView<uint16_t>(sample.document, sample.binary, {0, 1, 2, 0, 2, 2});
  sample.document["materials"][0]["emissiveFactor"] = {1, 1, 1};
  sample.document["extensionsUsed"] = {"KHR_materials_emissive_strength", "KHR_texture_transform"};
  const auto scene = sample.Load();
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->triangles.size(), 1u);
  EXPECT_EQ(scene->positions.size(), 3u);
  for (const glm::vec3& n : scene->normals) EXPECT_EQ(n, glm::vec3(0, 0, 1));
  EXPECT_EQ(scene->notes.size(), 6u);
}

TEST(LoadTest, RefusesMalformedAccessors) {
  {
    Sample sample;
    sample.document["accessors"][2]["count"] = 5;
    ExpectRefused(sample.Load(), "meshes[0].primitives[0].attributes.NORMAL");
  }
  {
    Sample sample;
    sample.document["accessors"][1]["count"] = uint64_t{1} << 40;
    ExpectRefused(sample.Load(), "attributes.POSITION", ErrorKind::kLimit);
  }
  {
    Sample sample;
    sample.document["accessors"][1]["byteOffset"] = (uint64_t{1} << 53) - 4;
    ExpectRefused(sample.Load(), "attributes.POSITION");
  }
  {
    Sample sample;
    sample.document["accessors"][1]["byteOffset"] = 2;
    ExpectRefused(sample.Load(), "not aligned");
  }
  {
    Sample sample;
    sample.document["bufferViews"][1]["byteLength"] = uint64_t{1} << 52;
    ExpectRefused(sample.Load(), "bufferViews[1]");
  }
  {
    Sample sample;
    sample.document["bufferViews"][1]["byteStride"] = 8;
    ExpectRefused(sample.Load(), "byteStride");
  }
  {
    Sample sample;
    sample.document["accessors"][1]["bufferView"] = 99;
    ExpectRefused(sample.Load(), "bufferViews[99]");
  }
  {
    Sample sample;
    sample.primitive()["attributes"]["NORMAL"] = 77;
    ExpectRefused(sample.Load(), "accessors[77]");
  }
  {
    Sample sample;
    sample.document["accessors"][1]["count"] = -4;
    ExpectRefused(sample.Load(), "accessors[1].count");
  }
  {
    Sample sample;
    sample.document["accessors"][1]["type"] = "MAT4";
    ExpectRefused(sample.Load(), "attributes.POSITION");
  }
}

Result<Scene> LoadWithin(const Sample& sample, const SceneLimits& limits) {
  return LoadSceneFromMemory(test::MakeGlb(sample.document, sample.binary), "test.glb", limits);
}

TEST(LoadTest, AccessorsWithoutBytesCannotAskForMuch) {
  for (const int accessor : {0, 1, 2}) {
    Sample sample;
    sample.document["accessors"][accessor].erase("bufferView");
    sample.document["accessors"][accessor]["count"] = 300'000'000;
    if (accessor == 1) sample.primitive().erase("indices");
    ExpectRefused(sample.Load(), accessor == 0 ? "indices" : "attributes.",
                  accessor == 2 ? ErrorKind::kBadInput : ErrorKind::kLimit);
  }
  Sample zeros;
  zeros.document["accessors"][2].erase("bufferView");
  EXPECT_TRUE(zeros.Load().ok());
}

TEST(LoadTest, EveryPrimitiveCountsTowardsTheLimits) {
  Sample sample;
  for (int i = 0; i < 2; ++i) sample.document["meshes"][0]["primitives"].push_back(sample.primitive());
  EXPECT_TRUE(LoadWithin(sample, {.vertices = 12, .triangles = 6}).ok());
  ExpectRefused(LoadWithin(sample, {.vertices = 11, .triangles = 6}), "meshes[0].primitives[2]",
                ErrorKind::kLimit);
  ExpectRefused(LoadWithin(sample, {.vertices = 12, .triangles = 5}), "meshes[0].primitives[2]",
                ErrorKind::kLimit);
}

TEST(LoadTest, InstancesCountBeforeTheyAreMade) {
  Sample sample;
  sample.document["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}}, {{"mesh", 0}, {"scale", {0, 0, 0}}}};
  sample.document["scenes"][0]["nodes"] = {0, 1, 2};
  EXPECT_TRUE(LoadWithin(sample, {.vertices = 8, .triangles = 4}).ok());
  ExpectRefused(LoadWithin(sample, {.vertices = 7, .triangles = 4}), "2 instances", ErrorKind::kLimit);
  ExpectRefused(LoadWithin(sample, {.vertices = 8, .triangles = 3}), "2 instances", ErrorKind::kLimit);
}

TEST(LoadTest, PartsOfASharedArrayCountByWhatTheyUse) {
  Sample sample;
  constexpr int kShared = 1000;
  std::vector<float> positions, normals;
  for (int i = 0; i < kShared; ++i) {
    positions.insert(positions.end(), {float(i), float(i) * i, 0});
    normals.insert(normals.end(), {0, 0, 1});
  }
  for (const auto& [accessor, values] : {std::pair{1, &positions}, {2, &normals}}) {
    sample.document["accessors"][accessor]["bufferView"] =
        test::AddView<float>(sample.document, sample.binary, *values);
    sample.document["accessors"][accessor]["count"] = kShared;
    for (const char* bound : {"min", "max"}) sample.document["accessors"][accessor].erase(bound);
  }
  sample.primitive()["attributes"].erase("TEXCOORD_0");
  sample.document["accessors"][0]["bufferView"] =
      test::AddView<uint16_t>(sample.document, sample.binary, {7, 900, 800, 7, 900, 3});
  const size_t moved = test::AddView<uint16_t>(sample.document, sample.binary, {6, 800});
  const size_t values = test::AddView<float>(sample.document, sample.binary, {1, 2, 3, 4, 5, 6});
  sample.document["accessors"][1]["sparse"] = {{"count", 2},
                                               {"indices", {{"bufferView", moved}, {"componentType", 5123}}},
                                               {"values", {{"bufferView", values}}}};
  const auto scene = LoadWithin(sample, {.vertices = kShared, .triangles = 2});
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  const std::vector<glm::vec3> expected = {{3, 9, 0}, {7, 49, 0}, {4, 5, 6}, {900, 810000, 0}};
  EXPECT_EQ(scene->positions, expected);
  const std::vector<std::array<uint32_t, 3>> triangles = {{1, 3, 2}, {1, 3, 0}};
  EXPECT_EQ(scene->triangles, triangles);
  EXPECT_EQ(scene->notes, std::vector<std::string>{"996 vertices that no triangle uses were dropped"});

  for (int i = 0; i < 300; ++i) sample.document["meshes"][0]["primitives"].push_back(sample.primitive());
  EXPECT_FALSE(LoadWithin(sample, {.vertices = 4 * 301 - 1}).ok());
  const auto many = LoadWithin(sample, {.vertices = 4 * 301});
  ASSERT_TRUE(many.ok()) << many.status().message();
  EXPECT_EQ(many->positions.size(), 4u * 301);
}

TEST(LoadTest, PositionsBeyondWhatCanBeTracedAreRefused) {
  for (const double scale : {1e16, 3e38, 1e300}) {
    Sample sample;
    sample.document["nodes"][0]["scale"] = {scale, 1, 1};
    ExpectRefused(sample.Load(), "nodes[0] (meshes[0]): puts a vertex farther than 1e15");
  }
  Sample sample;
  sample.document["accessors"][1]["bufferView"] =
      test::AddView<float>(sample.document, sample.binary, {0, 0, 0, 1e19f, 0, 0, 1, 1, 0, 0, 1, 0});
  ExpectRefused(sample.Load(), "scale the scene down");
  Sample near;
  near.document["nodes"][0]["scale"] = {9e14, 9e14, 9e14};
  EXPECT_TRUE(near.Load().ok());
  Sample camera;
  for (json& node : camera.document["nodes"]) {
    if (node.contains("camera")) node["translation"] = {0, 0, 1e19};
  }
  ExpectRefused(camera.Load(), ".camera: is farther than 1e17");
}

TEST(LoadTest, OneNoteForOneMaterialsColor) {
  Sample sample;
  sample.document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {2, 3, -1, 1};
  const auto scene = sample.Load();
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->notes,
            std::vector<std::string>{"materials[0]: baseColorFactor is outside [0, 1] and was clamped"});
}

TEST(LoadTest, RefusesIndicesOutOfRangeAndBadValues) {
  Sample sample;
  sample.document["accessors"][0]["bufferView"] =
      test::AddView<uint16_t>(sample.document, sample.binary, {0, 1, 2, 0, 2, 4});
  ExpectRefused(sample.Load(), "meshes[0].primitives[0].indices: index 4 at 5");

  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    Sample other;
    other.document["accessors"][1]["bufferView"] =
        test::AddView<float>(other.document, other.binary, {0, 0, 0, 1, bad, 0, 1, 1, 0, 0, 1, 0});
    ExpectRefused(other.Load(), "attributes.POSITION: element 1 is not a finite number");
  }
  Sample huge;
  huge.document["nodes"][0]["scale"] = {1e300, 1, 1};
  ExpectRefused(huge.Load(), "nodes[0]");
}

TEST(LoadTest, RefusesBadGraphsExtensionsAndImages) {
  {
    Sample sample;
    sample.document["nodes"] = {{{"children", {1}}}, {{"children", {0}}, {"mesh", 0}}};
    sample.document["scenes"][0]["nodes"] = {0};
    ExpectRefused(sample.Load(), "cycle");
    sample.document.erase("scenes");
    EXPECT_FALSE(sample.Load().ok());
  }
  {
    Sample sample;
    json nodes = json::array();
    for (int i = 0; i < 400; ++i) nodes.push_back({{"children", {i + 1}}});
    nodes.push_back({{"mesh", 0}});
    sample.document["nodes"] = nodes;
    sample.document["scenes"][0]["nodes"] = {0};
    ExpectRefused(sample.Load(), "nested", ErrorKind::kLimit);
  }
  {
    Sample sample;
    sample.document["extensionsRequired"] = {"EXT_unheard_of"};
    ExpectRefused(sample.Load(), "EXT_unheard_of");
  }
  {
    Sample sample;
    sample.document["nodes"][0]["mesh"] = 3;
    ExpectRefused(sample.Load(), "meshes[3]");
  }
  {
    Sample sample;
    sample.document["asset"]["version"] = "1.0";
    ExpectRefused(sample.Load(), "asset.version");
  }
  {
    Bytes bad = test::TexturedQuad();
    const std::string marker = "IDAT";
    const auto at = std::search(bad.begin(), bad.end(), marker.begin(), marker.end(),
                                [](std::byte a, char b) { return a == static_cast<std::byte>(b); });
    ASSERT_NE(at, bad.end());
    std::fill(at, at + 12, std::byte{0});
    ExpectRefused(LoadSceneFromMemory(bad, "test.glb"), "images[0]");
    SceneLimits limits;
    limits.image_side = 3;
    ExpectRefused(LoadSceneFromMemory(test::TexturedQuad(), "test.glb", limits), "images[0]",
                  ErrorKind::kLimit);
  }
  {
    Sample sample;
    const auto deep = std::string(100000, '[');
    Bytes bytes;
    for (const char c : "{\"asset\":" + deep) bytes.push_back(static_cast<std::byte>(c));
    ExpectRefused(LoadSceneFromMemory(bytes, "test.glb"), "nested", ErrorKind::kLimit);
  }
}

TEST(LoadTest, RefusesTruncationAtEveryByte) {
  const Bytes good = test::TexturedQuad();
  ASSERT_TRUE(LoadSceneFromMemory(good, "test.glb").ok());
  for (size_t size = 0; size < good.size(); size += size < 64 || size + 64 > good.size() ? 1 : 13) {
    EXPECT_FALSE(LoadSceneFromMemory(std::span(good).first(size), "test.glb").ok()) << size;
  }
}

class BesideTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = std::filesystem::path(testing::TempDir()) / ("glint_beside_" + std::to_string(getpid()));
    std::filesystem::create_directories(root_ / "scene");
    sample_.document["buffers"][0]["uri"] = "quad%20data.bin";
    ASSERT_TRUE(test::WriteBytes(root_ / "scene" / "quad data.bin", sample_.binary));
    ASSERT_TRUE(test::WriteBytes(root_ / "outside.bin", sample_.binary));
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  Result<Scene> LoadFile() {
    std::ofstream(root_ / "scene" / "scene.gltf") << sample_.document.dump();
    return LoadScene(root_ / "scene" / "scene.gltf");
  }

  std::filesystem::path root_;
  Sample sample_;
};

TEST_F(BesideTest, ReadsFilesBesideTheScene) {
  const auto scene = LoadFile();
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->triangles.size(), 2u);
}

TEST_F(BesideTest, RefusesToLeaveTheFolder) {
  std::filesystem::create_symlink("../outside.bin", root_ / "scene" / "link.bin");
  for (const std::string& uri : {std::string("../outside.bin"), std::string("%2e%2e/outside.bin"),
                                 std::string("sub/../../outside.bin"), (root_ / "outside.bin").string(),
                                 std::string("http://example.com/a.bin"), std::string("file:///etc/passwd"),
                                 std::string("..\\outside.bin"), std::string("link.bin"),
                                 std::string("absent.bin"), std::string("")}) {
    sample_.document["buffers"][0]["uri"] = uri;
    const auto scene = LoadFile();
    ASSERT_FALSE(scene.ok()) << uri;
    EXPECT_NE(scene.status().message().find("buffers[0]"), std::string::npos) << scene.status().message();
  }
}

TEST(LoadTest, MemoryHasNothingBesideIt) {
  Sample sample;
  sample.document["buffers"][0]["uri"] = "quad.bin";
  ExpectRefused(sample.Load(), "buffers[0].uri");
}

// The project's shared scenes, where they are present, with the counts that their README states.
TEST(LoadTest, SharedScenes) {
  std::filesystem::path data;
  if (const char* set = std::getenv("GLINT_SHARED_DATA")) data = set;
  for (std::filesystem::path at = GLINT_SOURCE_DIR; data.empty() && at != at.root_path();
       at = at.parent_path()) {
    if (std::filesystem::exists(at / ".." / "shared" / "data")) data = at / ".." / "shared" / "data";
  }
  const struct {
    const char* name;
    size_t vertices, triangles, materials;
  } scenes[] = {{"teapot", 10441, 20592, 1},
                {"teapot_plane", 19850, 39024, 2},
                {"bunny_diffuse", 27449, 54318, 2},
                {"goblets", 35335, 70272, 4},
                {"dragon_plane", 42357, 85017, 2},
                {"bird", 24504, 49004, 1},
                {"waterbottle_plane", 11958, 22942, 2},
                {"boombox_plane", 12984, 24468, 2}};
  for (const auto& expected : scenes) {
    const auto path = data / "scenes" / (std::string(expected.name) + ".glb");
    if (data.empty() || !std::filesystem::exists(path)) {
      std::printf("note: %s is not present; set GLINT_SHARED_DATA to check it\n", expected.name);
      continue;
    }
    const auto scene = LoadScene(path);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(scene->positions.size(), expected.vertices) << expected.name;
    EXPECT_EQ(scene->triangles.size(), expected.triangles) << expected.name;
    EXPECT_EQ(scene->materials.size(), expected.materials) << expected.name;
    EXPECT_TRUE(scene->notes.empty()) << expected.name;
  }
  for (const char* name : {"Avocado", "BoomBox", "Corset", "WaterBottle"}) {
    const auto path = data / "assets" / (std::string(name) + ".glb");
    if (data.empty() || !std::filesystem::exists(path)) continue;
    const auto scene = LoadScene(path);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(scene->images.size(), 2u) << name;
  }
}

}  // namespace
}  // namespace glint
