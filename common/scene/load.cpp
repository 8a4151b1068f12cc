// Loads glTF 2.0: parse and check the document, read materials, walk the nodes, and put each instance of a
// mesh into world space.
#include "common/scene/load.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "common/base/files.h"
#include "common/scene/bounds.h"
#include "common/scene/gltf_document.h"
#include "common/scene/gltf_material.h"
#include "common/scene/gltf_mesh.h"
#include "common/scene/gltf_schema.h"

namespace glint {
namespace {

// Extensions that a file may require.
const std::set<std::string> kSupported = {kDracoExtension, "KHR_materials_emissive_strength",
                                          "KHR_mesh_quantization"};

Status CheckExtensions(const tinygltf::Model& model, Scene& scene) {
  for (const std::string& name : model.extensionsRequired) {
    if (!kSupported.contains(name)) {
      return BadInput("extensionsRequired: '" + Printable(name) +
                      "' is not supported; export the scene without it");
    }
  }
  const std::set<std::string> used(model.extensionsUsed.begin(), model.extensionsUsed.end());
  for (const std::string& name : used) {
    if (name == "KHR_materials_emissive_strength") {
      scene.notes.push_back(name + " is ignored: nothing but the environment emits");
    } else if (!kSupported.contains(name)) {
      scene.notes.push_back("optional extension " + Printable(name) + " is ignored");
    }
  }
  return {};
}

glm::dmat4 LocalTransform(const tinygltf::Node& node) {
  glm::dmat4 m(1);
  if (node.matrix.size() == 16) {
    for (int i = 0; i < 16; ++i) m[i / 4][i % 4] = node.matrix[i];
    return m;
  }
  if (node.rotation.size() == 4) {
    glm::dvec4 q(node.rotation[0], node.rotation[1], node.rotation[2], node.rotation[3]);
    const double length = glm::length(q);
    if (length > 0) q /= length;
    const double x = q.x, y = q.y, z = q.z, w = q.w;
    m[0] = {1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0};
    m[1] = {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0};
    m[2] = {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0};
    if (length <= 0) m = glm::dmat4(1);
  }
  if (node.scale.size() == 3) {
    for (int i = 0; i < 3; ++i) m[i] *= node.scale[i];
  }
  if (node.translation.size() == 3) {
    m[3] = {node.translation[0], node.translation[1], node.translation[2], 1};
  }
  return m;
}

struct NodeVisit {
  int node;
  uint32_t depth;
  glm::dmat4 to_world;
};

class Loader {
 public:
  Loader(const GltfDocument& document, std::filesystem::path folder, const SceneLimits& limits)
      : document_(document),
        model_(document.model),
        bytes_(document, std::move(folder), limits.file_bytes),
        limits_(limits),
        budget_{limits.vertices, limits.triangles} {}

  Result<Scene> Load() {
    GLINT_RETURN_IF_ERROR(CheckExtensions(model_, scene_));
    GLINT_RETURN_IF_ERROR(ReadMaterials(document_, bytes_, limits_, scene_, uv_sets_));
    GLINT_ASSIGN_OR_RETURN(const std::vector<NodeVisit> visits, WalkNodes());
    for (const NodeVisit& visit : visits) {
      ++uses_[model_.nodes[visit.node].mesh];
      if (HasVolume(visit)) ++instances_[model_.nodes[visit.node].mesh];
    }
    for (const NodeVisit& visit : visits) {
      const std::string object = "nodes[" + std::to_string(visit.node) + "]";
      GLINT_RETURN_IF_ERROR(AddCamera(visit, object));
      GLINT_RETURN_IF_ERROR(AddMesh(visit, object));
    }
    if (scene_.triangles.empty()) return BadInput("has no triangles; export the scene with its meshes");
    if (scene_.materials.empty()) scene_.materials.emplace_back();
    AddNotes();
    scene_.content = HashScene(scene_);
    return std::move(scene_);
  }

 private:
  // Nodes of the default scene, parents before children, in the file's order. The graph must be a forest.
  Result<std::vector<NodeVisit>> WalkNodes() {
    GLINT_ASSIGN_OR_RETURN(const std::vector<int> roots, Roots());
    std::vector<NodeVisit> pending, visits;
    for (auto it = roots.rbegin(); it != roots.rend(); ++it) pending.push_back({*it, 1, glm::dmat4(1)});
    std::vector<bool> seen(model_.nodes.size(), false);
    while (!pending.empty()) {
      NodeVisit visit = pending.back();
      pending.pop_back();
      const std::string object = "nodes[" + std::to_string(visit.node) + "]";
      if (static_cast<size_t>(visit.node) >= model_.nodes.size()) {
        return BadInput(object + ": is referred to but does not exist; export the file again");
      }
      if (seen[visit.node]) {
        return BadInput(object + ": is reached twice (a cycle or two parents); export the file again");
      }
      if (visit.depth > limits_.node_depth) {
        return LimitExceeded(object + ": nodes are nested deeper than " + std::to_string(limits_.node_depth) +
                             "; flatten the hierarchy");
      }
      seen[visit.node] = true;
      const tinygltf::Node& node = model_.nodes[visit.node];
      visit.to_world = visit.to_world * LocalTransform(node);
      for (int c = 0; c < 16; ++c) {
        if (!std::isfinite(visit.to_world[c / 4][c % 4])) {
          return BadInput(object + ": its transform is not finite; correct its matrix or scale");
        }
      }
      for (auto it = node.children.rbegin(); it != node.children.rend(); ++it) {
        pending.push_back({*it, visit.depth + 1, visit.to_world});
      }
      visits.push_back(visit);
    }
    return visits;
  }

  Result<std::vector<int>> Roots() {
    if (!model_.scenes.empty()) {
      const int index = std::max(model_.defaultScene, 0);
      if (static_cast<size_t>(index) >= model_.scenes.size()) {
        return BadInput("scene: scenes[" + std::to_string(index) + "] does not exist; export the file again");
      }
      if (model_.scenes.size() > 1) {
        scene_.notes.push_back("of " + std::to_string(model_.scenes.size()) + " scenes, scenes[" +
                               std::to_string(index) + "] is used");
      }
      return model_.scenes[index].nodes;
    }
    std::vector<bool> is_child(model_.nodes.size(), false);
    for (const tinygltf::Node& node : model_.nodes) {
      for (const int child : node.children) {
        if (static_cast<size_t>(child) < is_child.size()) is_child[child] = true;
      }
    }
    std::vector<int> roots;
    for (size_t i = 0; i < is_child.size(); ++i) {
      if (!is_child[i]) roots.push_back(static_cast<int>(i));
    }
    return roots;
  }

  Status AddCamera(const NodeVisit& visit, const std::string& object) {
    const tinygltf::Node& node = model_.nodes[visit.node];
    if (node.camera < 0) return {};
    if (static_cast<size_t>(node.camera) >= model_.cameras.size()) {
      return BadInput(object + ".camera: cameras[" + std::to_string(node.camera) +
                      "] does not exist; export the file again");
    }
    const tinygltf::Camera& from = model_.cameras[node.camera];
    if (from.type != "perspective") {
      scene_.notes.push_back(object + ": its orthographic camera is ignored");
      return {};
    }
    const auto fov = static_cast<float>(from.perspective.yfov);
    const glm::dvec3 forward = -glm::dvec3(visit.to_world[2]), up = glm::dvec3(visit.to_world[1]);
    if (!(fov > 0 && fov < std::numbers::pi_v<float>) || !(glm::length(forward) > 0) ||
        !(glm::length(up) > 0)) {
      return BadInput(object + ".camera: its field of view or transform is not usable; correct the camera");
    }
    Camera camera;
    camera.name = from.name.empty() ? node.name : from.name;
    if (camera.name.empty()) camera.name = "camera" + std::to_string(scene_.cameras.size());
    camera.eye = glm::vec3(glm::dvec3(visit.to_world[3]));
    if (!Within(camera.eye, kMaxEye)) {
      return BadInput(object + ".camera: is farther than 1e17 from the origin; scale the scene down");
    }
    camera.forward = glm::vec3(glm::normalize(forward));
    camera.up = glm::vec3(glm::normalize(up));
    camera.vertical_fov = fov;
    scene_.cameras.push_back(camera);
    return {};
  }

  Status AddMesh(const NodeVisit& visit, const std::string& object) {
    const int mesh = model_.nodes[visit.node].mesh;
    if (mesh < 0) return {};
    if (static_cast<size_t>(mesh) >= model_.meshes.size()) {
      return BadInput(object + ".mesh: meshes[" + std::to_string(mesh) +
                      "] does not exist; export the file again");
    }
    has_skin_ = has_skin_ || model_.nodes[visit.node].skin >= 0;
    if (!parts_.contains(mesh)) GLINT_RETURN_IF_ERROR(ReadMesh(mesh));
    const std::string place = object + " (meshes[" + std::to_string(mesh) + "])";
    if (!HasVolume(visit)) {
      scene_.notes.push_back(object + ": its scale is zero, it is left out");
    } else {
      for (const MeshPart& part : parts_[mesh]) GLINT_RETURN_IF_ERROR(AddPart(part, visit.to_world, place));
    }
    if (--uses_[mesh] == 0) parts_.erase(mesh);
    return {};
  }

  // Primitives that have triangles.
  Status ReadMesh(int mesh) {
    std::vector<MeshPart> parts;
    for (size_t i = 0; i < model_.meshes[mesh].primitives.size(); ++i) {
      const int material = model_.meshes[mesh].primitives[i].material;
      if (material >= 0 && static_cast<size_t>(material) >= model_.materials.size()) {
        return BadInput("meshes[" + std::to_string(mesh) + "].primitives[" + std::to_string(i) +
                        "].material: " + "materials[" + std::to_string(material) +
                        "] does not exist; export the file again");
      }
      const int uv_set = material >= 0 ? uv_sets_[material] : 0;
      GLINT_ASSIGN_OR_RETURN(MeshPart part,
                             ReadPrimitive(document_, bytes_, mesh, i, uv_set, limits_, budget_, counts_));
      // All instances at once, before the first takes memory.
      scene_vertices_ += part.positions.size() * instances_[mesh];
      scene_triangles_ += part.triangles.size() * instances_[mesh];
      if (scene_vertices_ > limits_.vertices || scene_vertices_ >= kNone ||
          scene_triangles_ > limits_.triangles) {
        return LimitExceeded("meshes[" + std::to_string(mesh) + "]: with its " +
                             std::to_string(instances_[mesh]) + " instances the scene has more than " +
                             std::to_string(limits_.vertices) + " vertices or " +
                             std::to_string(limits_.triangles) + " triangles; simplify it");
      }
      if (!part.triangles.empty()) parts.push_back(std::move(part));
    }
    parts_[mesh] = std::move(parts);
    return {};
  }

  // A node of zero scale is left out.
  static bool HasVolume(const NodeVisit& visit) { return glm::determinant(glm::dmat3(visit.to_world)) != 0; }

  Status AddPart(const MeshPart& part, const glm::dmat4& to_world, const std::string& object) {
    const uint64_t first = scene_.positions.size();
    GLINT_RETURN_IF_ERROR(AddVertices(part, to_world, object));
    const uint16_t material = part.material >= 0 ? static_cast<uint16_t>(part.material) : DefaultMaterial();
    const bool mirrored = glm::determinant(glm::dmat3(to_world)) < 0;
    for (const auto& [a, b, c] : part.triangles) {
      const auto base = static_cast<uint32_t>(first);
      scene_.triangles.push_back({base + a, base + (mirrored ? c : b), base + (mirrored ? b : c)});
    }
    scene_.triangle_material.resize(scene_.triangles.size(), material);
    scene_.vertex_material.resize(scene_.positions.size(), material);
    return {};
  }

  Status AddVertices(const MeshPart& part, const glm::dmat4& to_world, const std::string& object) {
    const bool identity = to_world == glm::dmat4(1);
    const glm::dmat3 linear(to_world);
    const glm::dmat3 normal_matrix = glm::transpose(glm::inverse(linear));
    for (size_t i = 0; i < part.positions.size(); ++i) {
      const glm::vec3 position =
          identity ? part.positions[i] : glm::vec3(glm::dvec3(to_world * glm::dvec4(part.positions[i], 1)));
      glm::dvec3 normal(part.normals[i]);
      if (!identity) {
        normal = normal_matrix * normal;
        const double length = glm::length(normal);
        normal = length > 0 && std::isfinite(length) ? normal / length : glm::dvec3(0, 1, 0);
      }
      if (!Within(position, kMaxCoordinate)) {
        return BadInput(object + ": puts a vertex farther than 1e15 from the origin; scale the scene down");
      }
      scene_.positions.push_back(position);
      scene_.normals.push_back(identity ? part.normals[i] : glm::vec3(normal));
    }
    scene_.uvs.insert(scene_.uvs.end(), part.uvs.begin(), part.uvs.end());
    scene_.colors.insert(scene_.colors.end(), part.colors.begin(), part.colors.end());
    return {};
  }

  // glTF's default material, for primitives without one.
  uint16_t DefaultMaterial() {
    if (!default_material_) {
      default_material_ = static_cast<uint16_t>(scene_.materials.size());
      scene_.materials.emplace_back().name = "default";
      scene_.notes.push_back(
          "a primitive has no material and gets glTF's default (white metal, roughness 1)");
    }
    return *default_material_;
  }

  void AddNotes() {
    const auto note = [&](uint64_t count, const std::string& what) {
      if (count) scene_.notes.push_back(std::to_string(count) + " " + what);
    };
    note(counts_.degenerate_triangles, "triangles without area were dropped");
    note(counts_.unused_vertices, "vertices that no triangle uses were dropped");
    note(counts_.made_normals, "vertices had no normals; they were made");
    note(counts_.repaired_normals, "normals were zero or not of unit length; they were repaired");
    note(counts_.turned_normals, "normals pointed to the back of their faces; they were turned over");
    note(counts_.skipped_primitives, "primitives of points or lines were left out");
    if (has_skin_) scene_.notes.push_back("skins are ignored: meshes stand in their bind pose");
  }

  const GltfDocument& document_;
  const tinygltf::Model& model_;
  GltfBytes bytes_;
  const SceneLimits& limits_;
  Scene scene_;
  std::vector<int> uv_sets_;                           // by material
  std::map<int, std::vector<MeshPart>> parts_;         // by mesh, while instances of it are still to come
  std::map<int, uint64_t> uses_;                       // by mesh
  std::map<int, uint64_t> instances_;                  // by mesh: uses that are not left out
  MeshBudget budget_;                                  // of meshes as the file has them
  uint64_t scene_vertices_ = 0, scene_triangles_ = 0;  // of all instances of the meshes read
  MeshCounts counts_;
  std::optional<uint16_t> default_material_;
  bool has_skin_ = false;
};

Result<Scene> LoadBytes(std::span<const std::byte> bytes, const std::filesystem::path& folder,
                        const SceneLimits& limits) {
  // The libraries underneath may throw (memory, malformed data); nothing goes further.
  try {
    GLINT_ASSIGN_OR_RETURN(const GltfDocument document, ParseGltf(bytes));
    return Loader(document, folder, limits).Load();
  } catch (const std::bad_alloc&) {
    return LimitExceeded("needs more memory than there is; simplify the scene");
  } catch (const std::exception& error) {
    return BadInput("cannot be read (" + Printable(error.what()) + "); export the file again");
  }
}

}  // namespace

Result<Scene> LoadScene(const std::filesystem::path& path, const SceneLimits& limits) {
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, limits.file_bytes));
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  auto scene = LoadBytes(bytes, folder, limits);
  if (!scene.ok()) return scene.status().WithContext(path.string());
  return scene;
}

Result<Scene> LoadSceneFromMemory(std::span<const std::byte> bytes, const std::string& name,
                                  const SceneLimits& limits) {
  if (bytes.size() > limits.file_bytes) {
    return LimitExceeded(name + ": " + std::to_string(bytes.size()) + " bytes, more than the limit of " +
                         std::to_string(limits.file_bytes));
  }
  auto scene = LoadBytes(bytes, {}, limits);
  if (!scene.ok()) return scene.status().WithContext(name);
  return scene;
}

}  // namespace glint
