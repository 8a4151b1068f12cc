#include "common/scene/gltf_mesh.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numeric>
#include <optional>
#include <utility>

#include "common/scene/gltf_accessor.h"
#include "common/scene/gltf_draco.h"
#include "common/scene/gltf_schema.h"
#include "common/scene/normals.h"

namespace glint {
namespace {

// Lengths this close to one are left alone, so that a written scene reads back to the same bits.
constexpr float kUnitTolerance = 1e-5f;
// Beyond this, a normal counts as repaired; quantized normals are within it.
constexpr float kSloppyUnit = 0.02f;

// A primitive's attributes, from Draco where it has them and else from accessors.
class Attributes {
 public:
  Attributes(const GltfDocument& document, GltfBytes& bytes, const tinygltf::Primitive& primitive,
             std::string object, const SceneLimits& limits)
      : document_(document),
        bytes_(bytes),
        primitive_(primitive),
        object_(std::move(object)),
        limits_(limits) {}

  Status DecodeDracoIfAny() {
    const auto extension = primitive_.extensions.find(kDracoExtension);
    if (extension == primitive_.extensions.end()) return {};
    const std::string name = object_ + ".extensions." + kDracoExtension;
    std::map<std::string, int> ids;
    std::map<std::string, bool> normalize;
    const tinygltf::Value& list = extension->second.Get("attributes");
    if (list.IsObject()) {
      for (const std::string& key : list.Keys()) {
        if (!Wanted(key)) continue;
        ids[key] = list.Get(key).GetNumberAsInt();
        GLINT_ASSIGN_OR_RETURN(normalize[key], IsNormalized(key));
      }
    }
    auto view = bytes_.View(extension->second.Get("bufferView").GetNumberAsInt());
    if (!view.ok()) return view.status().WithContext(name);
    GLINT_ASSIGN_OR_RETURN(draco_,
                           DecodeDraco(*view, ids, normalize, limits_.vertices, limits_.triangles, name));
    return {};
  }

  bool has_draco() const { return draco_.has_value(); }
  const DracoMesh& draco() const { return *draco_; }

  /// Absent, or `count` elements (any number if 0).
  Result<std::optional<FloatArray>> Read(const std::string& name, int min_components, int max_components,
                                         size_t count) const {
    const std::string object = object_ + ".attributes." + name;
    FloatArray array;
    const auto accessor = primitive_.attributes.find(name);
    if (draco_ && draco_->attributes.contains(name)) {
      array = draco_->attributes.at(name);
      if (array.components < min_components || array.components > max_components) {
        return BadInput(object + ": has " + std::to_string(array.components) +
                        " components in the Draco data; export the file again");
      }
    } else if (accessor != primitive_.attributes.end()) {
      GLINT_ASSIGN_OR_RETURN(array, ReadFloats(document_, bytes_, accessor->second, object, min_components,
                                               max_components, limits_.vertices));
    } else {
      return std::optional<FloatArray>();
    }
    if (count && array.count() != count) {
      return BadInput(object + ": has " + std::to_string(array.count()) + " elements where POSITION has " +
                      std::to_string(count) + "; export the file again");
    }
    return std::optional<FloatArray>(std::move(array));
  }

  /// Indices as the primitive's mode uses them; 0, 1, 2, ... without an index accessor.
  Result<std::vector<uint32_t>> Indices(size_t vertices) const {
    if (draco_) return draco_->indices;
    const auto accessor = primitive_.attributes.find(kIndicesAttribute);
    std::vector<uint32_t> indices;
    if (accessor == primitive_.attributes.end()) {
      indices.resize(vertices);
      std::iota(indices.begin(), indices.end(), 0u);
      return indices;
    }
    const std::string object = object_ + ".indices";
    GLINT_ASSIGN_OR_RETURN(indices,
                           ReadIndices(document_, bytes_, accessor->second, object, 3 * limits_.triangles));
    for (size_t i = 0; i < indices.size(); ++i) {
      if (indices[i] >= vertices) {
        return BadInput(object + ": index " + std::to_string(indices[i]) + " at " + std::to_string(i) +
                        " is beyond the " + std::to_string(vertices) + " vertices; export the file again");
      }
    }
    return indices;
  }

 private:
  static bool Wanted(const std::string& name) {
    return name == "POSITION" || name == "NORMAL" || name == "COLOR_0" || name.rfind("TEXCOORD_", 0) == 0;
  }
  Result<bool> IsNormalized(const std::string& name) const {
    const auto accessor = primitive_.attributes.find(name);
    if (accessor == primitive_.attributes.end()) return false;
    GLINT_ASSIGN_OR_RETURN(const tinygltf::Accessor* info,
                           FindAccessor(document_, accessor->second, object_ + ".attributes." + name));
    return info->normalized;
  }

  const GltfDocument& document_;
  GltfBytes& bytes_;
  const tinygltf::Primitive& primitive_;
  std::string object_;
  const SceneLimits& limits_;
  std::optional<DracoMesh> draco_;
};

using Triangles = std::vector<std::array<uint32_t, 3>>;

Result<Triangles> MakeTriangles(const std::vector<uint32_t>& indices, int mode, bool draco,
                                const std::string& object) {
  Triangles triangles;
  if (draco || mode == TINYGLTF_MODE_TRIANGLES) {
    if (indices.size() % 3 != 0) {
      return BadInput(object + ": " + std::to_string(indices.size()) +
                      " indices do not make whole triangles; export the file again");
    }
    for (size_t i = 0; i < indices.size(); i += 3) {
      triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
    }
  } else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
    for (size_t i = 0; i + 2 < indices.size(); ++i) {
      triangles.push_back({indices[i], indices[i + 1 + i % 2], indices[i + 2 - i % 2]});
    }
  } else {  // fan
    for (size_t i = 1; i + 1 < indices.size(); ++i) {
      triangles.push_back({indices[i], indices[i + 1], indices[0]});
    }
  }
  return triangles;
}

void DropDegenerate(const std::vector<glm::vec3>& positions, Triangles& triangles, MeshCounts& counts) {
  const auto degenerate = [&](const std::array<uint32_t, 3>& t) {
    const glm::dvec3 a = positions[t[0]];
    const glm::dvec3 cross = glm::cross(glm::dvec3(positions[t[1]]) - a, glm::dvec3(positions[t[2]]) - a);
    return !(glm::dot(cross, cross) > 0);
  };
  counts.degenerate_triangles += std::erase_if(triangles, degenerate);
}

template <class T>
void Keep(std::vector<T>& values, const std::vector<uint32_t>& kept) {
  for (size_t i = 0; i < kept.size(); ++i) values[i] = values[kept[i]];  // kept ascends
  values.resize(kept.size());
}

// Exporters often let many primitives share one array of vertices, of which each uses a part.
void DropUnusedVertices(MeshPart& part, MeshCounts& counts) {
  std::vector<uint32_t> renamed(part.positions.size(), kNone);
  for (const auto& triangle : part.triangles) {
    for (const uint32_t i : triangle) renamed[i] = 0;
  }
  std::vector<uint32_t> kept;
  for (uint32_t i = 0; i < renamed.size(); ++i) {
    if (renamed[i] == kNone) continue;
    renamed[i] = static_cast<uint32_t>(kept.size());
    kept.push_back(i);
  }
  if (kept.size() == renamed.size()) return;
  counts.unused_vertices += renamed.size() - kept.size();
  Keep(part.positions, kept);
  Keep(part.normals, kept);
  Keep(part.uvs, kept);
  Keep(part.colors, kept);
  for (auto& triangle : part.triangles) {
    for (uint32_t& i : triangle) i = renamed[i];
  }
}

void RepairNormals(MeshPart& part, MeshCounts& counts) {
  std::vector<uint32_t> unusable;
  for (uint32_t i = 0; i < part.normals.size(); ++i) {
    glm::vec3& normal = part.normals[i];
    const double length = glm::length(glm::dvec3(normal));
    if (length < 1e-3) {
      unusable.push_back(i);
      continue;
    }
    if (std::abs(length - 1) > kSloppyUnit) ++counts.repaired_normals;
    if (std::abs(length - 1) > kUnitTolerance) normal = glm::vec3(glm::dvec3(normal) / length);
  }
  if (unusable.empty()) return;
  counts.repaired_normals += unusable.size();
  const auto made = AngleWeightedNormals(part.positions, part.triangles);
  for (const uint32_t i : unusable) part.normals[i] = made[i];
}

}  // namespace

Result<MeshPart> ReadPrimitive(const GltfDocument& document, GltfBytes& bytes, size_t mesh,
                               size_t primitive_index, int uv_set, const SceneLimits& limits,
                               MeshCounts& counts) {
  const std::string object =
      "meshes[" + std::to_string(mesh) + "].primitives[" + std::to_string(primitive_index) + "]";
  const tinygltf::Primitive& primitive = document.model.meshes[mesh].primitives[primitive_index];
  MeshPart part;
  part.material = primitive.material;
  if (primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
    return BadInput(object + ".mode: " + std::to_string(primitive.mode) +
                    " is not known; export the file again");
  }
  if (primitive.mode < TINYGLTF_MODE_TRIANGLES) {
    ++counts.skipped_primitives;
    return part;
  }

  Attributes attributes(document, bytes, primitive, object, limits);
  GLINT_RETURN_IF_ERROR(attributes.DecodeDracoIfAny());
  GLINT_ASSIGN_OR_RETURN(const auto positions, attributes.Read("POSITION", 3, 3, 0));
  if (!positions) return BadInput(object + ".attributes.POSITION: is missing; export the file again");
  const size_t count = positions->count();
  if (attributes.has_draco() && attributes.draco().points != count) {
    return BadInput(object + ".attributes.POSITION: does not match the Draco data; export the file again");
  }
  GLINT_ASSIGN_OR_RETURN(const auto normals, attributes.Read("NORMAL", 3, 3, count));
  GLINT_ASSIGN_OR_RETURN(const auto uvs, attributes.Read("TEXCOORD_" + std::to_string(uv_set), 2, 2, count));
  GLINT_ASSIGN_OR_RETURN(const auto colors, attributes.Read("COLOR_0", 3, 4, count));
  GLINT_ASSIGN_OR_RETURN(const auto indices, attributes.Indices(count));
  GLINT_ASSIGN_OR_RETURN(part.triangles,
                         MakeTriangles(indices, primitive.mode, attributes.has_draco(), object));

  part.positions.resize(count);
  part.normals.resize(count, glm::vec3(0));
  part.uvs.resize(count, glm::vec2(0));
  part.colors.resize(count, glm::vec4(1));
  for (size_t i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c) part.positions[i][c] = positions->values[3 * i + c];
    for (int c = 0; normals && c < 3; ++c) part.normals[i][c] = normals->values[3 * i + c];
    for (int c = 0; uvs && c < 2; ++c) part.uvs[i][c] = uvs->values[2 * i + c];
    for (int c = 0; colors && c < colors->components; ++c) {
      part.colors[i][c] = std::clamp(colors->values[colors->components * i + c], 0.0f, 1.0f);
    }
  }
  DropDegenerate(part.positions, part.triangles, counts);
  DropUnusedVertices(part, counts);
  if (normals) {
    RepairNormals(part, counts);
  } else {
    part.normals = AngleWeightedNormals(part.positions, part.triangles);
    counts.made_normals += part.positions.size();
  }
  return part;
}

}  // namespace glint
