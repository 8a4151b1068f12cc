// libFuzzer target: the glTF reader must take any bytes without crash, hang or undefined behaviour, and a
// scene that it accepts must be consistent.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "common/scene/load.h"

namespace {

void Check(bool good) {
  if (!good) std::abort();
}

void CheckScene(const glint::Scene& scene) {
  const size_t vertices = scene.positions.size();
  Check(!scene.triangles.empty() && !scene.materials.empty());
  Check(scene.normals.size() == vertices && scene.uvs.size() == vertices && scene.colors.size() == vertices);
  Check(scene.vertex_material.size() == vertices && scene.triangle_material.size() == scene.triangles.size());
  for (const auto& triangle : scene.triangles) {
    for (const uint32_t i : triangle) Check(i < vertices);
  }
  for (uint32_t i = 0; i < vertices; ++i) {
    const glm::vec3& n = scene.normals[i];
    Check(std::abs(n.x * n.x + n.y * n.y + n.z * n.z - 1) < 1e-3f);
    Check(scene.vertex_material[i] < scene.materials.size());
    const glint::SurfacePoint point = glint::EvaluateVertexMaterial(scene, i);
    Check(point.roughness >= 0 && point.roughness <= 1 && point.metallic >= 0 && point.metallic <= 1);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  glint::SceneLimits limits;
  limits.file_bytes = 1 << 20;
  limits.vertices = limits.triangles = 20000;
  limits.image_side = 512;
  limits.image_pixels = 1 << 18;
  limits.node_depth = 16;
  const auto scene = glint::LoadSceneFromMemory(std::as_bytes(std::span(data, size)), "fuzz", limits);
  if (scene.ok()) CheckScene(*scene);
  return 0;
}
