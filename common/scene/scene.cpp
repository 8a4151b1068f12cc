#include "common/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

#include "common/base/srgb.h"

namespace glint {
namespace {

// sRGB decoding of all 256 codes.
const std::array<float, 256>& SrgbToLinear() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (int i = 0; i < 256; ++i) t[i] = static_cast<float>(SrgbDecode(i / 255.0));
    return t;
  }();
  return table;
}

// Index of a texel in [0, size) under the wrap mode; `i` may lie anywhere.
int WrapIndex(int64_t i, int size, Wrap wrap) {
  if (wrap == Wrap::kClamp) return static_cast<int>(std::clamp<int64_t>(i, 0, size - 1));
  const int64_t period = wrap == Wrap::kRepeat ? size : int64_t{2} * size;
  const int64_t m = ((i % period) + period) % period;
  return static_cast<int>(m < size ? m : period - 1 - m);
}

// Texels around a texture co-ordinate and the weight of the second.
struct Tap {
  int first, second;
  float weight;
};

Tap MakeTap(float coordinate, int size, Wrap wrap) {
  // Repetition first, in double: a large co-ordinate must neither overflow an index nor lose its fraction.
  double c = std::isfinite(coordinate) ? coordinate : 0.0;
  if (wrap == Wrap::kRepeat) c -= std::floor(c);
  if (wrap == Wrap::kMirror) c -= 2 * std::floor(c / 2);
  if (wrap == Wrap::kClamp) c = std::clamp(c, 0.0, 1.0);
  const double x = c * size - 0.5;
  const double floor = std::floor(x);
  const auto i = static_cast<int64_t>(floor);
  return {WrapIndex(i, size, wrap), WrapIndex(i + 1, size, wrap), static_cast<float>(x - floor)};
}

// Bilinear look-up; uv as in glTF: (0, 0) is the first texel's outer corner, v grows downwards.
glm::vec4 SampleTexture(const Scene& scene, uint32_t texture_index, glm::vec2 uv, bool srgb) {
  const Texture& texture = scene.textures[texture_index];
  if (texture.image == kNone) return glm::vec4(1);
  const Image& image = scene.images[texture.image];
  if (image.width <= 0 || image.height <= 0) return glm::vec4(1);
  const Tap x = MakeTap(uv.x, image.width, texture.wrap_u);
  const Tap y = MakeTap(uv.y, image.height, texture.wrap_v);
  const auto texel = [&](int ix, int iy) {
    const uint8_t* p = image.rgba.data() + (static_cast<size_t>(iy) * image.width + ix) * 4;
    const auto& decode = SrgbToLinear();
    if (srgb) return glm::vec4(decode[p[0]], decode[p[1]], decode[p[2]], p[3] / 255.0f);
    return glm::vec4(p[0], p[1], p[2], p[3]) / 255.0f;
  };
  const glm::vec4 top = glm::mix(texel(x.first, y.first), texel(x.second, y.first), x.weight);
  const glm::vec4 bottom = glm::mix(texel(x.first, y.second), texel(x.second, y.second), x.weight);
  return glm::mix(top, bottom, y.weight);
}

SurfacePoint Evaluate(const Scene& scene, const Material& material, glm::vec2 uv, const glm::vec4& color) {
  SurfacePoint point;
  point.model = material.model;
  point.double_sided = material.double_sided;
  point.exponent = material.exponent;
  point.specular = material.specular;
  point.diffuse = material.diffuse;
  point.base_color = material.base_color * glm::vec3(color);
  point.metallic = material.metallic;
  point.roughness = material.roughness;
  if (material.base_color_texture != kNone) {
    point.base_color *= glm::vec3(SampleTexture(scene, material.base_color_texture, uv, true));
  }
  if (material.metallic_roughness_texture != kNone) {
    const glm::vec4 sample = SampleTexture(scene, material.metallic_roughness_texture, uv, false);
    point.roughness *= sample.g;
    point.metallic *= sample.b;
  }
  point.base_color = glm::clamp(point.base_color, 0.0f, 1.0f);
  return point;
}

}  // namespace

SurfacePoint EvaluateMaterial(const Scene& scene, uint32_t triangle, float u, float v) {
  const auto& [a, b, c] = scene.triangles[triangle];
  const float w = 1 - u - v;
  return Evaluate(scene, scene.materials[scene.triangle_material[triangle]],
                  w * scene.uvs[a] + u * scene.uvs[b] + v * scene.uvs[c],
                  w * scene.colors[a] + u * scene.colors[b] + v * scene.colors[c]);
}

SurfacePoint EvaluateVertexMaterial(const Scene& scene, uint32_t vertex) {
  return Evaluate(scene, scene.materials[scene.vertex_material[vertex]], scene.uvs[vertex],
                  scene.colors[vertex]);
}

namespace {

void HashColor(Hasher& hasher, const glm::vec3& c) { hasher.Add(c.x).Add(c.y).Add(c.z); }

void HashMaterial(Hasher& hasher, const Material& m) {
  hasher.String(m.name).Add(m.model).Add(m.double_sided);
  HashColor(hasher, m.base_color);
  hasher.Add(m.metallic).Add(m.roughness).Add(m.base_color_texture).Add(m.metallic_roughness_texture);
  hasher.Add(m.exponent);
  HashColor(hasher, m.specular);
  HashColor(hasher, m.diffuse);
}

template <class T>
void HashArray(Hasher& hasher, const std::vector<T>& values) {
  hasher.Array(std::span<const T>(values));
}

}  // namespace

Digest HashScene(const Scene& scene) {
  Hasher hasher;
  hasher.String("glint scene 1");
  HashArray(hasher, scene.positions);
  HashArray(hasher, scene.normals);
  HashArray(hasher, scene.uvs);
  HashArray(hasher, scene.colors);
  HashArray(hasher, scene.triangles);
  HashArray(hasher, scene.triangle_material);
  HashArray(hasher, scene.vertex_material);
  hasher.Add(uint64_t{scene.materials.size()});
  for (const Material& material : scene.materials) HashMaterial(hasher, material);
  hasher.Add(uint64_t{scene.textures.size()});
  for (const Texture& t : scene.textures) hasher.Add(t.image).Add(t.wrap_u).Add(t.wrap_v);
  hasher.Add(uint64_t{scene.images.size()});
  for (const Image& image : scene.images) {
    hasher.String(image.name).Add(int32_t{image.width}).Add(int32_t{image.height});
    HashArray(hasher, image.rgba);
  }
  return hasher.Finish();
}

}  // namespace glint
