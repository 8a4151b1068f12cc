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
             std::string object, const SceneLimits& limits, MeshBudget& budget)
      : document_(document),
        bytes_(bytes),
        primitive_(primitive),
        object_(std::move(object)),
        limits_(limits),
        budget_(budget) {}

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
                           DecodeDraco(*view, ids, normalize, budget_.vertices, budget_.triangles, name));
    return {};
  }

  bool has_draco() const { return draco_.has_value(); }
  bool has(const std::string& name) const {
    return primitive_.attributes.contains(name) || (draco_ && draco_->attributes.contains(name));
  }

  /// Number of vertices to choose from: POSITION's.
  Result<size_t> Count() const {
    const std::string object = object_ + ".attributes.POSITION";
    const auto accessor = primitive_.attributes.find("POSITION");
    if (draco_ && draco_->attributes.contains("POSITION")) return size_t{draco_->points};
    if (accessor == primitive_.attributes.end()) {
      return BadInput(object + ": is missing; export the file again");
    }
    GLINT_ASSIGN_OR_RETURN(const tinygltf::Accessor* info, FindAccessor(document_, accessor->second, object));
    if (draco_ && draco_->points != info->count) {
      return BadInput(object + ": does not match the Draco data; export the file again");
    }
    if (info->count > limits_.vertices || info->count >= kNone) {
      return LimitExceeded(object + ": " + std::to_string(info->count) +
                           " elements, more than the limit of " + std::to_string(limits_.vertices) +
                           "; simplify the scene");
    }
    return size_t{info->count};
  }

  /// Absent, or the wanted ones (null: all) of `count` elements.
  Result<std::optional<FloatArray>> Read(const std::string& name, int min_components, int max_components,
                                         size_t count, const std::vector<uint32_t>* wanted) const {
    const std::string object = object_ + ".attributes." + name;
    const auto wrong_count = [&](size_t has) {
      return BadInput(object + ": has " + std::to_string(has) + " elements where POSITION has " +
                      std::to_string(count) + "; export the file again");
    };
    const auto accessor = primitive_.attributes.find(name);
    if (draco_ && draco_->attributes.contains(name)) {
      const FloatArray& array = draco_->attributes.at(name);
      if (array.components < min_components || array.components > max_components) {
        return BadInput(object + ": has " + std::to_string(array.components) +
                        " components in the Draco data; export the file again");
      }
      if (array.count() != count) return wrong_count(array.count());
      return std::optional<FloatArray>(wanted ? Chosen(array, *wanted) : array);
    }
    if (accessor == primitive_.attributes.end()) return std::optional<FloatArray>();
    GLINT_ASSIGN_OR_RETURN(const tinygltf::Accessor* info, FindAccessor(document_, accessor->second, object));
    if (info->count != count) return wrong_count(info->count);
    GLINT_ASSIGN_OR_RETURN(FloatArray array,
                           ReadFloats(document_, bytes_, accessor->second, object, min_components,
                                      max_components, limits_.vertices, wanted));
    return std::optional<FloatArray>(std::move(array));
  }

  /// Indices as the primitive's mode uses them, each below `vertices`; 0, 1, 2, ... without an index
  /// accessor. Charges the budget for their triangles.
  Result<std::vector<uint32_t>> Indices(size_t vertices) {
    if (draco_) {
      GLINT_RETURN_IF_ERROR(Charge(draco_->indices.size() / 3, budget_.triangles, "triangles"));
      return std::move(draco_->indices);
    }
    const auto accessor = primitive_.attributes.find(kIndicesAttribute);
    std::vector<uint32_t> indices;
    if (accessor == primitive_.attributes.end()) {
      GLINT_RETURN_IF_ERROR(Charge(TriangleCount(vertices), budget_.triangles, "triangles"));
      indices.resize(vertices);
      std::iota(indices.begin(), indices.end(), 0u);
      return indices;
    }
    const std::string object = object_ + ".indices";
    GLINT_ASSIGN_OR_RETURN(const tinygltf::Accessor* info, FindAccessor(document_, accessor->second, object));
    GLINT_RETURN_IF_ERROR(Charge(TriangleCount(info->count), budget_.triangles, "triangles"));
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

  Status ChargeVertices(uint64_t count) { return Charge(count, budget_.vertices, "vertices"); }

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
  uint64_t TriangleCount(uint64_t indices) const {
    if (primitive_.mode == TINYGLTF_MODE_TRIANGLES) return indices / 3;
    return std::max<uint64_t>(indices, 2) - 2;
  }
  Status Charge(uint64_t count, uint64_t& left, const char* what) const {
    if (count > left) {
      return LimitExceeded(object_ + ": its " + std::to_string(count) + " " + what +
                           " and those of the primitives before it are more than the limit of " +
                           std::to_string(limits_.vertices) + " vertices and " +
                           std::to_string(limits_.triangles) + " triangles; simplify the scene");
    }
    left -= count;
    return {};
  }
  static FloatArray Chosen(const FloatArray& array, const std::vector<uint32_t>& wanted) {
    FloatArray chosen{array.components, {}};
    chosen.values.reserve(wanted.size() * array.components);
    for (const uint32_t i : wanted) {
      const auto from = array.values.begin() + std::ptrdiff_t{i} * array.components;
      chosen.values.insert(chosen.values.end(), from, from + array.components);
    }
    return chosen;
  }

  const GltfDocument& document_;
  GltfBytes& bytes_;
  const tinygltf::Primitive& primitive_;
  std::string object_;
  const SceneLimits& limits_;
  MeshBudget& budget_;
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
    triangles.reserve(indices.size() / 3);
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
  triangles.shrink_to_fit();
}

// The vertices of `count` that the triangles use, ascending; the triangles then name places in that list.
std::vector<uint32_t> UsedVertices(size_t count, Triangles& triangles) {
  std::vector<uint32_t> used;
  if (triangles.size() < count / 64) {
    // A small part of a large array: the work must follow the part.
    for (const auto& triangle : triangles) used.insert(used.end(), triangle.begin(), triangle.end());
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    for (auto& triangle : triangles) {
      for (uint32_t& i : triangle)
        i = static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), i) - used.begin());
    }
    return used;
  }
  std::vector<uint32_t> renamed(count, kNone);
  for (const auto& triangle : triangles) {
    for (const uint32_t i : triangle) renamed[i] = 0;
  }
  used.reserve(count - static_cast<size_t>(std::count(renamed.begin(), renamed.end(), kNone)));
  for (uint32_t i = 0; i < count; ++i) {
    if (renamed[i] == kNone) continue;
    renamed[i] = static_cast<uint32_t>(used.size());
    used.push_back(i);
  }
  for (auto& triangle : triangles) {
    for (uint32_t& i : triangle) i = renamed[i];
  }
  return used;
}

template <class T>
void Keep(std::vector<T>& values, const std::vector<uint32_t>& kept) {
  for (size_t i = 0; i < kept.size(); ++i) values[i] = values[kept[i]];  // kept ascends
  values.resize(kept.size());
  values.shrink_to_fit();
}

// Those that only dropped triangles used.
void DropUnusedVertices(MeshPart& part, MeshCounts& counts) {
  const std::vector<uint32_t> kept = UsedVertices(part.positions.size(), part.triangles);
  if (kept.size() == part.positions.size()) return;
  counts.unused_vertices += part.positions.size() - kept.size();
  Keep(part.positions, kept);
  Keep(part.normals, kept);
  Keep(part.uvs, kept);
  Keep(part.colors, kept);
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

// A normal that points to the back of every face around is the opposite of what the faces say, which decide
// where the front is. Those that only lean over are left: there are reasons for that.
void TurnNormalsToFronts(MeshPart& part, MeshCounts& counts) {
  constexpr double kBackwards = -0.5;  // cosine: by more than 120 degrees
  std::vector<uint8_t> kept(part.positions.size(), 0);
  for (const auto& triangle : part.triangles) {
    const glm::dvec3 a = part.positions[triangle[0]];
    const glm::dvec3 cross =
        glm::cross(glm::dvec3(part.positions[triangle[1]]) - a, glm::dvec3(part.positions[triangle[2]]) - a);
    const double least = kBackwards * glm::length(cross);
    for (const uint32_t i : triangle) kept[i] |= glm::dot(cross, glm::dvec3(part.normals[i])) > least;
  }
  for (size_t i = 0; i < kept.size(); ++i) {
    if (kept[i]) continue;
    part.normals[i] = -part.normals[i];
    ++counts.turned_normals;
  }
}

// Reads the used ones of `stored` vertices.
Status ReadVertices(const Attributes& attributes, int uv_set, size_t stored,
                    const std::vector<uint32_t>& used, MeshPart& part) {
  const size_t count = used.size();
  const std::vector<uint32_t>* wanted = count == stored ? nullptr : &used;
  GLINT_ASSIGN_OR_RETURN(const auto positions, attributes.Read("POSITION", 3, 3, stored, wanted));
  GLINT_ASSIGN_OR_RETURN(const auto normals, attributes.Read("NORMAL", 3, 3, stored, wanted));
  GLINT_ASSIGN_OR_RETURN(const auto uvs,
                         attributes.Read("TEXCOORD_" + std::to_string(uv_set), 2, 2, stored, wanted));
  GLINT_ASSIGN_OR_RETURN(const auto colors, attributes.Read("COLOR_0", 3, 4, stored, wanted));
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
  return {};
}

}  // namespace

Result<MeshPart> ReadPrimitive(const GltfDocument& document, GltfBytes& bytes, size_t mesh,
                               size_t primitive_index, int uv_set, const SceneLimits& limits,
                               MeshBudget& budget, MeshCounts& counts) {
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

  Attributes attributes(document, bytes, primitive, object, limits, budget);
  GLINT_RETURN_IF_ERROR(attributes.DecodeDracoIfAny());
  GLINT_ASSIGN_OR_RETURN(const size_t stored, attributes.Count());
  {
    GLINT_ASSIGN_OR_RETURN(const auto indices, attributes.Indices(stored));
    GLINT_ASSIGN_OR_RETURN(part.triangles,
                           MakeTriangles(indices, primitive.mode, attributes.has_draco(), object));
  }
  // Exporters often let many primitives share one array of vertices, of which each uses a part.
  const std::vector<uint32_t> used = UsedVertices(stored, part.triangles);
  counts.unused_vertices += stored - used.size();
  GLINT_RETURN_IF_ERROR(attributes.ChargeVertices(used.size()));
  GLINT_RETURN_IF_ERROR(ReadVertices(attributes, uv_set, stored, used, part));
  DropDegenerate(part.positions, part.triangles, counts);
  DropUnusedVertices(part, counts);
  if (attributes.has("NORMAL")) {
    RepairNormals(part, counts);
    TurnNormalsToFronts(part, counts);
  } else {
    part.normals = AngleWeightedNormals(part.positions, part.triangles);
    counts.made_normals += part.positions.size();
  }
  return part;
}

}  // namespace glint
