// Writes a scene as GLB: one mesh for each run of triangles of one material, so that a scene whose materials
// own contiguous ranges (all that Glint loads or generates) reads back with every vertex and triangle in its
// place.
#include <algorithm>
#include <cstring>
#include <exception>
#include <glm/geometric.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>

#include "common/base/files.h"
#include "common/scene/load.h"

namespace glint {
namespace {

using nlohmann::json;

enum GltfConstant { kUnsignedInt = 5125, kFloat = 5126, kArrayBuffer = 34962, kElementArrayBuffer = 34963 };

json Numbers(const glm::vec3& v) { return {v.x, v.y, v.z}; }

class GlbBuilder {
 public:
  explicit GlbBuilder(const Scene& scene) : scene_(scene) {
    document_["asset"] = {{"version", "2.0"}, {"generator", "glint " GLINT_VERSION}};
    document_["scene"] = 0;
  }

  std::vector<std::byte> Build() {
    for (const Material& material : scene_.materials) document_["materials"].push_back(ToJson(material));
    for (size_t first = 0; first < scene_.triangles.size();) {
      size_t last = first + 1;
      while (last < scene_.triangles.size() &&
             scene_.triangle_material[last] == scene_.triangle_material[first]) {
        ++last;
      }
      AddMesh(first, last);
      first = last;
    }
    for (const Camera& camera : scene_.cameras) AddCamera(camera);
    json roots = json::array();
    for (size_t i = 0; i < document_["nodes"].size(); ++i) roots.push_back(i);
    document_["scenes"] = json::array({{{"nodes", roots}}});
    document_["buffers"] = json::array({{{"byteLength", binary_.size()}}});
    return Assemble();
  }

 private:
  static json ToJson(const Material& material) {
    json out = {
        {"name", material.name},
        {"doubleSided", material.double_sided},
        {"pbrMetallicRoughness",
         {{"baseColorFactor", {material.base_color.r, material.base_color.g, material.base_color.b, 1}},
          {"metallicFactor", material.metallic},
          {"roughnessFactor", material.roughness}}}};
    if (material.model != MaterialModel::kMetallicRoughness) {
      out["extras"]["glint_brdf"] = {
          {"model", material.model == MaterialModel::kPhong ? "phong" : "blinn-phong"},
          {"exponent", material.exponent},
          {"specular", Numbers(material.specular)},
          {"diffuse", Numbers(material.diffuse)}};
    }
    return out;
  }

  template <class T>
  json AddAccessor(const std::vector<T>& values, const char* type, GltfConstant component,
                   GltfConstant target) {
    const auto bytes = std::as_bytes(std::span(values));
    document_["bufferViews"].push_back({{"buffer", 0},
                                        {"byteOffset", binary_.size()},
                                        {"byteLength", bytes.size()},
                                        {"target", static_cast<int>(target)}});
    binary_.insert(binary_.end(), bytes.begin(), bytes.end());
    document_["accessors"].push_back({{"bufferView", document_["bufferViews"].size() - 1},
                                      {"componentType", static_cast<int>(component)},
                                      {"count", bytes.size() / (component == kUnsignedInt ? 4 : sizeof(T))},
                                      {"type", type}});
    return document_["accessors"].size() - 1;
  }

  // Vertices that the triangles use, in the scene's order.
  std::vector<uint32_t> UsedVertices(size_t first, size_t last) const {
    std::vector<uint32_t> used;
    for (size_t i = first; i < last; ++i) {
      used.insert(used.end(), scene_.triangles[i].begin(), scene_.triangles[i].end());
    }
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    return used;
  }

  template <class T>
  static std::vector<T> Select(const std::vector<T>& values, const std::vector<uint32_t>& used) {
    std::vector<T> selected;
    selected.reserve(used.size());
    for (const uint32_t i : used) selected.push_back(values[i]);
    return selected;
  }

  void AddMesh(size_t first, size_t last) {
    const std::vector<uint32_t> used = UsedVertices(first, last);
    std::vector<uint32_t> indices;
    for (size_t i = first; i < last; ++i) {
      for (const uint32_t vertex : scene_.triangles[i]) {
        indices.push_back(
            static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), vertex) - used.begin()));
      }
    }
    json attributes;
    const auto positions = Select(scene_.positions, used);
    attributes["POSITION"] = AddAccessor(positions, "VEC3", kFloat, kArrayBuffer);
    AddBounds(positions);
    attributes["NORMAL"] = AddAccessor(Select(scene_.normals, used), "VEC3", kFloat, kArrayBuffer);
    const auto uvs = Select(scene_.uvs, used);
    if (std::any_of(uvs.begin(), uvs.end(), [](const glm::vec2& v) { return v != glm::vec2(0); })) {
      attributes["TEXCOORD_0"] = AddAccessor(uvs, "VEC2", kFloat, kArrayBuffer);
    }
    const auto colors = Select(scene_.colors, used);
    if (std::any_of(colors.begin(), colors.end(), [](const glm::vec4& v) { return v != glm::vec4(1); })) {
      attributes["COLOR_0"] = AddAccessor(colors, "VEC4", kFloat, kArrayBuffer);
    }
    const uint16_t material = scene_.triangle_material[first];
    const json primitive = {{"attributes", attributes},
                            {"indices", AddAccessor(indices, "SCALAR", kUnsignedInt, kElementArrayBuffer)},
                            {"material", material}};
    const std::string& name = scene_.materials[material].name;
    document_["meshes"].push_back({{"name", name}, {"primitives", json::array({primitive})}});
    document_["nodes"].push_back({{"name", name}, {"mesh", document_["meshes"].size() - 1}});
  }

  // glTF wants the bounds of positions.
  void AddBounds(const std::vector<glm::vec3>& positions) {
    glm::vec3 lo = positions[0], hi = positions[0];
    for (const glm::vec3& p : positions) {
      for (int c = 0; c < 3; ++c) {
        lo[c] = std::min(lo[c], p[c]);
        hi[c] = std::max(hi[c], p[c]);
      }
    }
    document_["accessors"].back()["min"] = Numbers(lo);
    document_["accessors"].back()["max"] = Numbers(hi);
  }

  void AddCamera(const Camera& camera) {
    document_["cameras"].push_back({{"name", camera.name},
                                    {"type", "perspective"},
                                    {"perspective", {{"yfov", camera.vertical_fov}, {"znear", 0.01}}}});
    const glm::dvec3 back = -glm::normalize(glm::dvec3(camera.forward));
    const glm::dvec3 right = glm::normalize(glm::cross(glm::dvec3(camera.up), back));
    const glm::dvec3 up = glm::cross(back, right), eye(camera.eye);
    document_["nodes"].push_back({{"name", camera.name},
                                  {"camera", document_["cameras"].size() - 1},
                                  {"matrix",
                                   {right.x, right.y, right.z, 0, up.x, up.y, up.z, 0, back.x, back.y, back.z,
                                    0, eye.x, eye.y, eye.z, 1}}});
  }

  std::vector<std::byte> Assemble() const {
    std::string text = document_.dump(-1, ' ', false, json::error_handler_t::replace);
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const uint64_t padded = (binary_.size() + 3) / 4 * 4;
    const uint64_t total = 12 + 8 + text.size() + 8 + padded;
    if (total > std::numeric_limits<uint32_t>::max()) return {};
    std::vector<std::byte> out;
    const auto put = [&](uint32_t value) {
      for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<std::byte>(value >> shift));
    };
    put(0x46546C67);
    put(2);
    put(static_cast<uint32_t>(total));
    put(static_cast<uint32_t>(text.size()));
    put(0x4E4F534A);
    const auto json_bytes = std::as_bytes(std::span(text));
    out.insert(out.end(), json_bytes.begin(), json_bytes.end());
    put(static_cast<uint32_t>(padded));
    put(0x004E4942);
    out.insert(out.end(), binary_.begin(), binary_.end());
    out.resize(total, std::byte{0});
    return out;
  }

  const Scene& scene_;
  json document_;
  std::vector<std::byte> binary_;
};

}  // namespace

Status SaveScene(const Scene& scene, const std::filesystem::path& path) {
  if (!scene.textures.empty()) {
    return UsageError(path.string() + ": a scene with textures cannot be written; keep its original file");
  }
  if (scene.triangles.empty())
    return UsageError(path.string() + ": a scene without triangles cannot be written");
  try {
    const std::vector<std::byte> bytes = GlbBuilder(scene).Build();
    if (bytes.empty()) return LimitExceeded(path.string() + ": GLB holds 4 GiB at most; simplify the scene");
    return PublishFile(path, bytes);
  } catch (const std::exception& error) {
    return InternalError(path.string() + ": " + error.what());
  }
}

}  // namespace glint
