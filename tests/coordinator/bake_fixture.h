#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "common/scene/generate.h"
#include "coordinator/bake.h"

namespace glint::bake_fixture {

inline Scene Generated(const std::string& name, uint32_t vertices = 500, float exponent = 32) {
  Result<Scene> scene = GenerateScene(name, {vertices, exponent});
  EXPECT_TRUE(scene.ok()) << scene.status().message();
  return std::move(scene).value();
}

/// Half metal, half paint: GGX lobes and a diffuse part on one surface, seen from both sides.
inline Scene GeneratedPaint(const std::string& name, uint32_t vertices = 500) {
  Scene scene = Generated(name, vertices, 0);
  for (Material& material : scene.materials) {
    material.model = MaterialModel::kMetallicRoughness;
    material.base_color = {0.8f, 0.5f, 0.3f};
    material.metallic = 0.5f;
    material.roughness = 0.4f;
    material.double_sided = true;
  }
  scene.content = HashScene(scene);
  return scene;
}

/// A floor of two triangles under a ball: far too few vertices beside enough of them.
inline Scene BallOnFloor() {
  Scene scene = Generated("sphere", 700);
  const auto first = static_cast<uint32_t>(scene.positions.size());
  for (const glm::vec2 corner : {glm::vec2(-4, -4), {-4, 4}, {4, 4}, {4, -4}}) {
    scene.positions.push_back({corner.x, -1.1f, corner.y});
    scene.normals.push_back({0, 1, 0});
    scene.uvs.push_back({0, 0});
    scene.colors.push_back({1, 1, 1, 1});
    scene.vertex_material.push_back(0);
  }
  scene.triangles.push_back({first, first + 1, first + 2});
  scene.triangles.push_back({first, first + 2, first + 3});
  scene.triangle_material.insert(scene.triangle_material.end(), 2, 0);
  scene.content = HashScene(scene);
  return scene;
}

/// Few directions and layers: a bake of a fraction of a second.
inline BakeOptions SmallOptions(GatherMethod method = GatherMethod::kShared) {
  BakeOptions options;
  options.settings.method = method;
  options.settings.grid_level = 1;
  options.settings.max_rays = 512;
  options.settings.paper_rays = 8;
  options.settings.slice_lobes = 3;
  options.settings.lobe_tolerance = 0.02f;
  options.max_layers = 2;
  options.layer_tolerance = 0;
  options.estimate_slices = 16;
  options.threads = 2;
  return options;
}

inline std::vector<std::byte> BytesOf(const std::filesystem::path& path) {
  Result<std::vector<std::byte>> bytes = ReadFile(path, uint64_t{1} << 30);
  EXPECT_TRUE(bytes.ok()) << bytes.status().message();
  return bytes.ok() ? std::move(bytes).value() : std::vector<std::byte>();
}

/// Files of a work folder's `kind` ("chunks" or "tasks") that are in place, of all bakes.
inline std::vector<std::filesystem::path> StoredFiles(const std::filesystem::path& work,
                                                      const std::string& kind) {
  constexpr size_t kNameLength = 64;  // temporaries have longer names
  std::vector<std::filesystem::path> files;
  std::error_code error;
  using Iterator = std::filesystem::recursive_directory_iterator;
  for (Iterator i(work, error), end; !error && i != end; i.increment(error)) {
    const bool of_kind = i->path().parent_path().parent_path().filename() == kind;
    if (of_kind && i->path().filename().string().size() == kNameLength) files.push_back(i->path());
  }
  return files;
}

}  // namespace glint::bake_fixture
