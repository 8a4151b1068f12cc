#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "common/base/hash.h"

namespace glint {

inline constexpr uint32_t kNone = 0xFFFFFFFFu;

/// 8-bit RGBA image of a texture; sRGB decoding is the user's matter (base colour is sRGB, metallic-roughness
/// linear).
struct Image {
  std::string name;
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;  ///< height x width x 4, top row first
};

/// glTF sampler wrap modes.
enum class Wrap : uint8_t { kRepeat, kClamp, kMirror };

struct Texture {
  uint32_t image = kNone;
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
};

enum class MaterialModel : uint8_t { kMetallicRoughness, kPhong, kBlinnPhong };

/// A surface's reflectance, constant over the surface but for its textures. All colours linear.
struct Material {
  std::string name;
  MaterialModel model = MaterialModel::kMetallicRoughness;
  bool double_sided = false;
  // metallic-roughness
  glm::vec3 base_color{1};                      ///< in [0, 1]
  float metallic = 1;                           ///< in [0, 1]
  float roughness = 1;                          ///< in [0, 1], perceptual; alpha = roughness^2
  uint32_t base_color_texture = kNone;          ///< index into Scene::textures
  uint32_t metallic_roughness_texture = kNone;  ///< G roughness, B metallic
  // Phong and Blinn-Phong, by `extras.glint_brdf` (docs/scenes.md)
  float exponent = 32;
  glm::vec3 specular{0};
  glm::vec3 diffuse{0};
};

/// A perspective camera: looks along `forward`, vertical field of view in radians.
struct Camera {
  std::string name;
  glm::vec3 eye{0, 0, 1}, forward{0, 0, -1}, up{0, 1, 0};
  float vertical_fov = 0.7f;
};

/// Closed or open triangle surfaces in world space, y up, right-handed, any unit of length. Node transforms
/// and instances are already applied. Vertices are as the file has them (split where normals or co-ordinates
/// split).
struct Scene {
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;                  ///< unit; made (angle-weighted) where the file has none
  std::vector<glm::vec2> uvs;                      ///< zero where the file has none
  std::vector<glm::vec4> colors;                   ///< COLOR_0, or white; multiplies the base colour
  std::vector<std::array<uint32_t, 3>> triangles;  ///< counter-clockwise seen from the front
  std::vector<uint16_t> triangle_material;         ///< index into materials
  std::vector<uint16_t>
      vertex_material;  ///< of the first triangle that uses the vertex (a vertex belongs to one primitive)
  std::vector<Material> materials;  ///< at least one
  std::vector<Texture> textures;
  std::vector<Image> images;
  std::vector<Camera> cameras;
  std::vector<std::string> notes;  ///< what was ignored, repaired or assumed, for the user
  Digest content;                  ///< hash of everything above but cameras and notes
};

/// Reflectance parameters at one surface point, textures applied.
struct SurfacePoint {
  MaterialModel model = MaterialModel::kMetallicRoughness;
  glm::vec3 base_color{1};  ///< metallic-roughness
  float metallic = 1, roughness = 1;
  float exponent = 32;  ///< Phong, Blinn-Phong
  glm::vec3 specular{0}, diffuse{0};
  bool double_sided = false;
};

/// Material of `triangle` at barycentric (u, v) (weights 1-u-v, u, v of its three vertices), bilinear texture
/// look-up.
SurfacePoint EvaluateMaterial(const Scene& scene, uint32_t triangle, float u, float v);
/// Material at a vertex.
SurfacePoint EvaluateVertexMaterial(const Scene& scene, uint32_t vertex);

/// Recomputes `content` (after building a scene by hand).
Digest HashScene(const Scene& scene);

}  // namespace glint
