#include "common/scene/gltf_schema.h"

#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace glint {
namespace {

using nlohmann::json;

enum class Kind {
  kIndex,   // integer in [0, 2^31)
  kSize,    // integer in [0, 2^53]
  kNumber,  // finite
  kBool,
  kString,
  kNumbers,   // array of `length` numbers (any if 0)
  kIndices,   // array of indices
  kStrings,   // array of strings
  kIndexMap,  // object of indices
  kObject,    // object of a schema
  kObjects,   // array of objects of a schema
};

struct Field;
using Schema = std::vector<Field>;

struct Field {
  const char* key;
  Kind kind;
  bool required = false;
  const Schema* schema = nullptr;
  size_t length = 0;
};

Status Wrong(const std::string& path, const std::string& wanted) {
  return BadInput(path + ": must be " + wanted + "; export the file again or correct it");
}

bool IsInteger(const json& value, uint64_t largest) {
  return value.is_number_unsigned() && value.get<uint64_t>() <= largest;
}

constexpr uint64_t kLargestIndex = std::numeric_limits<int32_t>::max();
constexpr uint64_t kLargestSize = uint64_t{1} << 53;

Result<json> CheckObject(const json& value, const Schema& schema, const std::string& path);

Status CheckArray(const json& value, const std::string& path, const std::string& what,
                  bool (*good)(const json&)) {
  if (!value.is_array()) return Wrong(path, "an array of " + what);
  for (size_t i = 0; i < value.size(); ++i) {
    if (!good(value[i])) return Wrong(path + "[" + std::to_string(i) + "]", what);
  }
  return {};
}

Result<json> CheckObjects(const json& value, const Schema& schema, const std::string& path) {
  if (!value.is_array()) return Wrong(path, "an array of objects");
  json checked = json::array();
  for (size_t i = 0; i < value.size(); ++i) {
    GLINT_ASSIGN_OR_RETURN(json item, CheckObject(value[i], schema, path + "[" + std::to_string(i) + "]"));
    checked.push_back(std::move(item));
  }
  return checked;
}

Status CheckIndexMap(const json& value, const std::string& path) {
  if (!value.is_object()) return Wrong(path, "an object of indices");
  for (const auto& [key, index] : value.items()) {
    if (!IsInteger(index, kLargestIndex)) return Wrong(path + "." + key, "an index (0 to 2^31 - 1)");
  }
  return {};
}

// Checks one value and returns what to keep of it.
Result<json> CheckField(const json& value, const Field& field, const std::string& path) {
  switch (field.kind) {
    case Kind::kIndex:
      if (!IsInteger(value, kLargestIndex)) return Wrong(path, "an integer from 0 to 2^31 - 1");
      return value;
    case Kind::kSize:
      if (!IsInteger(value, kLargestSize)) return Wrong(path, "an integer from 0 to 2^53");
      return value;
    case Kind::kNumber:
      if (!value.is_number()) return Wrong(path, "a number");
      return value;
    case Kind::kBool:
      if (!value.is_boolean()) return Wrong(path, "true or false");
      return value;
    case Kind::kString:
      if (!value.is_string()) return Wrong(path, "a string");
      return value;
    case Kind::kNumbers:
      GLINT_RETURN_IF_ERROR(CheckArray(value, path, "numbers", [](const json& v) { return v.is_number(); }));
      if (field.length && value.size() != field.length) {
        return Wrong(path, "an array of " + std::to_string(field.length) + " numbers");
      }
      return value;
    case Kind::kIndices:
      GLINT_RETURN_IF_ERROR(
          CheckArray(value, path, "indices", [](const json& v) { return IsInteger(v, kLargestIndex); }));
      return value;
    case Kind::kStrings:
      GLINT_RETURN_IF_ERROR(CheckArray(value, path, "strings", [](const json& v) { return v.is_string(); }));
      return value;
    case Kind::kIndexMap:
      GLINT_RETURN_IF_ERROR(CheckIndexMap(value, path));
      return value;
    case Kind::kObject:
      return CheckObject(value, *field.schema, path);
    case Kind::kObjects:
      return CheckObjects(value, *field.schema, path);
  }
  return InternalError("unknown kind of glTF member");
}

Result<json> CheckObject(const json& value, const Schema& schema, const std::string& path) {
  if (!value.is_object()) return Wrong(path.empty() ? "document" : path, "an object");
  json checked = json::object();
  for (const Field& field : schema) {
    const std::string member = path.empty() ? field.key : path + "." + field.key;
    const auto it = value.find(field.key);
    if (it == value.end()) {
      if (field.required) return BadInput(member + ": is missing; export the file again or add it");
      continue;
    }
    GLINT_ASSIGN_OR_RETURN(checked[field.key], CheckField(*it, field, member));
  }
  return checked;
}

// The parts of glTF 2.0 that matter here; the specification's own names.
const Schema& DocumentSchema() {
  using enum Kind;
  static const Schema asset = {{"version", kString, true}, {"minVersion", kString}};
  static const Schema buffer = {{"uri", kString}, {"byteLength", kSize, true}};
  static const Schema view = {
      {"buffer", kIndex, true}, {"byteOffset", kSize}, {"byteLength", kSize, true}, {"byteStride", kSize}};
  static const Schema sparse_indices = {
      {"bufferView", kIndex, true}, {"byteOffset", kIndex}, {"componentType", kIndex, true}};
  static const Schema sparse_values = {{"bufferView", kIndex, true}, {"byteOffset", kIndex}};
  static const Schema sparse = {{"count", kIndex, true},
                                {"indices", kObject, true, &sparse_indices},
                                {"values", kObject, true, &sparse_values}};
  static const Schema accessor = {{"bufferView", kIndex},
                                  {"byteOffset", kSize},
                                  {"normalized", kBool},
                                  {"componentType", kIndex, true},
                                  {"count", kSize, true},
                                  {"type", kString, true},
                                  {"sparse", kObject, false, &sparse}};
  static const Schema draco = {{"bufferView", kIndex, true}, {"attributes", kIndexMap, true}};
  static const Schema primitive_extensions = {{kDracoExtension, kObject, false, &draco}};
  static const Schema primitive = {{"attributes", kIndexMap, true},
                                   {"indices", kIndex},
                                   {"material", kIndex},
                                   {"mode", kIndex},
                                   {"extensions", kObject, false, &primitive_extensions}};
  static const Schema mesh = {{"name", kString}, {"primitives", kObjects, true, &primitive}};
  static const Schema node = {{"name", kString},
                              {"mesh", kIndex},
                              {"camera", kIndex},
                              {"skin", kIndex},
                              {"children", kIndices},
                              {"matrix", kNumbers, false, nullptr, 16},
                              {"translation", kNumbers, false, nullptr, 3},
                              {"rotation", kNumbers, false, nullptr, 4},
                              {"scale", kNumbers, false, nullptr, 3}};
  static const Schema scene = {{"name", kString}, {"nodes", kIndices}};
  static const Schema texture_info = {{"index", kIndex, true}, {"texCoord", kIndex}};
  static const Schema pbr = {{"baseColorFactor", kNumbers, false, nullptr, 4},
                             {"baseColorTexture", kObject, false, &texture_info},
                             {"metallicFactor", kNumber},
                             {"roughnessFactor", kNumber},
                             {"metallicRoughnessTexture", kObject, false, &texture_info}};
  static const Schema material = {{"name", kString},
                                  {"doubleSided", kBool},
                                  {"alphaMode", kString},
                                  {"emissiveFactor", kNumbers, false, nullptr, 3},
                                  {"emissiveTexture", kObject, false, &texture_info},
                                  {"normalTexture", kObject, false, &texture_info},
                                  {"occlusionTexture", kObject, false, &texture_info},
                                  {"pbrMetallicRoughness", kObject, false, &pbr}};
  static const Schema image = {
      {"name", kString}, {"uri", kString}, {"mimeType", kString}, {"bufferView", kIndex}};
  static const Schema texture = {{"sampler", kIndex}, {"source", kIndex}};
  static const Schema sampler = {{"wrapS", kIndex}, {"wrapT", kIndex}};
  static const Schema perspective = {{"yfov", kNumber, true}, {"znear", kNumber, true}};
  static const Schema orthographic = {
      {"xmag", kNumber, true}, {"ymag", kNumber, true}, {"zfar", kNumber, true}, {"znear", kNumber, true}};
  static const Schema camera = {{"name", kString},
                                {"type", kString, true},
                                {"perspective", kObject, false, &perspective},
                                {"orthographic", kObject, false, &orthographic}};
  static const Schema document = {
      {"asset", kObject, true, &asset},          {"extensionsUsed", kStrings},
      {"extensionsRequired", kStrings},          {"buffers", kObjects, false, &buffer},
      {"bufferViews", kObjects, false, &view},   {"accessors", kObjects, false, &accessor},
      {"meshes", kObjects, false, &mesh},        {"nodes", kObjects, false, &node},
      {"scenes", kObjects, false, &scene},       {"scene", kIndex},
      {"materials", kObjects, false, &material}, {"images", kObjects, false, &image},
      {"textures", kObjects, false, &texture},   {"samplers", kObjects, false, &sampler},
      {"cameras", kObjects, false, &camera}};
  return document;
}

// `extras` may be anything in glTF; only ours is looked at, and then it must be right.
const Schema& BrdfExtrasSchema() {
  using enum Kind;
  static const Schema brdf = {{"model", kString, true},
                              {"exponent", kNumber, true},
                              {"specular", kNumbers, false, nullptr, 3},
                              {"diffuse", kNumbers, false, nullptr, 3}};
  static const Schema extras = {{"glint_brdf", kObject, false, &brdf}};
  return extras;
}

Status KeepBrdfExtras(const json& document, json& checked) {
  if (!checked.contains("materials")) return {};
  for (size_t i = 0; i < checked["materials"].size(); ++i) {
    const json& material = document["materials"][i];
    const auto extras = material.find("extras");
    if (extras == material.end() || !extras->is_object() || !extras->contains("glint_brdf")) continue;
    GLINT_ASSIGN_OR_RETURN(
        checked["materials"][i]["extras"],
        CheckObject(*extras, BrdfExtrasSchema(), "materials[" + std::to_string(i) + "].extras"));
  }
  return {};
}

void MoveIndicesToAttributes(json& checked) {
  if (!checked.contains("meshes")) return;
  for (json& mesh : checked["meshes"]) {
    for (json& primitive : mesh["primitives"]) {
      json& attributes = primitive["attributes"];
      attributes.erase(kIndicesAttribute);
      if (!primitive.contains("indices")) continue;
      attributes[kIndicesAttribute] = primitive["indices"];
      primitive.erase("indices");
    }
  }
}

}  // namespace

Result<json> CheckGltfJson(const json& document) {
  GLINT_ASSIGN_OR_RETURN(json checked, CheckObject(document, DocumentSchema(), ""));
  GLINT_RETURN_IF_ERROR(KeepBrdfExtras(document, checked));
  MoveIndicesToAttributes(checked);
  return checked;
}

}  // namespace glint
