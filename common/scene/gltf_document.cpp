#include "common/scene/gltf_document.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "common/base/files.h"
#include "common/scene/gltf_schema.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Parsed JSON takes some ten times its text; scenes of millions of triangles have a few hundred kilobytes of
// it.
constexpr uint64_t kMaxJsonBytes = uint64_t{256} << 20;
constexpr int kMaxJsonDepth = 128;

constexpr uint32_t kGlbMagic = 0x46546C67, kChunkJson = 0x4E4F534A, kChunkBinary = 0x004E4942;

uint32_t ReadU32(std::span<const std::byte> bytes, uint64_t offset) {
  uint32_t value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

struct Chunks {
  std::span<const std::byte> json, binary;
};

// GLB: magic, version, length; then chunks of length, type, bytes; all 32-bit little-endian.
Result<Chunks> SplitGlb(std::span<const std::byte> bytes) {
  if (bytes.size() < 20) return BadInput("GLB header is cut short; copy or export the file again");
  if (const uint32_t version = ReadU32(bytes, 4); version != 2) {
    return BadInput("GLB version " + std::to_string(version) + " is not supported; export as glTF 2.0");
  }
  const uint64_t length = ReadU32(bytes, 8);
  if (length < 20 || length > bytes.size()) {
    return BadInput("GLB says " + std::to_string(length) + " bytes but has " + std::to_string(bytes.size()) +
                    "; copy or export the file again");
  }
  Chunks chunks;
  uint64_t offset = 12;
  for (int index = 0; offset + 8 <= length; ++index) {
    const uint64_t size = ReadU32(bytes, offset);
    const uint32_t type = ReadU32(bytes, offset + 4);
    if (size > length - offset - 8) {
      return BadInput("GLB chunk " + std::to_string(index) +
                      " reaches beyond the file; export the file again");
    }
    const auto chunk = bytes.subspan(offset + 8, size);
    if (index == 0 && type != kChunkJson)
      return BadInput("GLB has no JSON chunk first; export the file again");
    if (index == 0) chunks.json = chunk;
    if (index == 1 && type == kChunkBinary) chunks.binary = chunk;
    offset += 8 + size;
  }
  return chunks;
}

// Nesting is bounded before parsing: later steps recurse.
bool TooDeep(std::string_view text) {
  int depth = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      if (++depth > kMaxJsonDepth) return true;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return false;
}

Result<json> ParseJson(std::span<const std::byte> bytes) {
  if (bytes.size() > kMaxJsonBytes) {
    return LimitExceeded("the JSON part has " + std::to_string(bytes.size()) +
                         " bytes, more than the limit of " + std::to_string(kMaxJsonBytes) +
                         "; keep data in binary buffers");
  }
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (TooDeep(text))
    return LimitExceeded("the JSON part is nested deeper than " + std::to_string(kMaxJsonDepth));
  json document = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (document.is_discarded()) {
    return BadInput(
        "is neither GLB nor valid glTF JSON; check that it is the right file, or export it again");
  }
  return CheckGltfJson(document);
}

// What says where bytes are is ours to read; tinygltf gets the rest.
void TakeSources(json& document, GltfDocument& result) {
  for (const json& buffer : document.value("buffers", json::array())) {
    result.buffers.push_back(
        {buffer.contains("uri"), buffer.value("uri", std::string()), buffer["byteLength"].get<uint64_t>()});
  }
  for (const json& image : document.value("images", json::array())) {
    result.images.push_back({image.value("name", std::string()), image.value("uri", std::string()),
                             image.contains("bufferView") ? image["bufferView"].get<int>() : -1});
  }
  document.erase("buffers");
  document.erase("images");
}

Status ParseModel(const json& document, tinygltf::Model& model) {
  const std::string text = document.dump(-1, ' ', false, json::error_handler_t::replace);
  tinygltf::TinyGLTF parser;
  std::string error, warning;
  const bool parsed = parser.LoadASCIIFromString(&model, &error, &warning, text.c_str(),
                                                 static_cast<unsigned>(text.size()), "");
  if (!parsed) return BadInput("is not valid glTF 2.0: " + Printable(error) + "; export the file again");
  // tinygltf drops primitives that it does not understand; a scene with holes is worse than an error.
  const json meshes = document.value("meshes", json::array());
  for (size_t i = 0; i < model.meshes.size(); ++i) {
    if (model.meshes[i].primitives.size() != meshes[i]["primitives"].size()) {
      return BadInput("meshes[" + std::to_string(i) + "]: a primitive is not valid glTF 2.0");
    }
  }
  return {};
}

std::optional<std::vector<std::byte>> DecodeBase64(std::string_view text) {
  static const std::array<int8_t, 256> values = [] {
    std::array<int8_t, 256> table;
    table.fill(-1);
    const std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < digits.size(); ++i)
      table[static_cast<uint8_t>(digits[i])] = static_cast<int8_t>(i);
    return table;
  }();
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  if (text.size() % 4 == 1) return std::nullopt;
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() / 4 * 3 + 3);
  uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const int value = values[static_cast<uint8_t>(c)];
    if (value < 0) return std::nullopt;
    bits = (bits << 6) | static_cast<uint32_t>(value);
    count += 6;
    if (count >= 8) {
      count -= 8;
      bytes.push_back(static_cast<std::byte>(bits >> count));
    }
  }
  return bytes;
}

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string DecodePercent(const std::string& uri) {
  std::string text;
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size() && HexDigit(uri[i + 1]) >= 0 && HexDigit(uri[i + 2]) >= 0) {
      text += static_cast<char>(HexDigit(uri[i + 1]) * 16 + HexDigit(uri[i + 2]));
      i += 2;
    } else {
      text += uri[i];
    }
  }
  return text;
}

// A relative path that goes down only.
bool IsBeside(const std::string& name) {
  if (name.empty() || name[0] == '/' || name.find_first_of(":\\") != std::string::npos) return false;
  if (std::any_of(name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) < 32; }))
    return false;
  const fs::path path(name);
  return path.is_relative() && std::find(path.begin(), path.end(), "..") == path.end();
}

}  // namespace

std::string Printable(const std::string& text) {
  std::string out = text.substr(0, 120);
  for (char& c : out) {
    if (static_cast<unsigned char>(c) < 32 || c == 127) c = ' ';
  }
  return text.size() > out.size() ? out + "..." : out;
}

Result<GltfDocument> ParseGltf(std::span<const std::byte> bytes) {
  Chunks chunks{bytes, {}};
  if (bytes.size() >= 4 && ReadU32(bytes, 0) == kGlbMagic) {
    GLINT_ASSIGN_OR_RETURN(chunks, SplitGlb(bytes));
  }
  GLINT_ASSIGN_OR_RETURN(json document, ParseJson(chunks.json));
  const std::string version = document["asset"]["version"].get<std::string>();
  if (version.rfind("2.", 0) != 0) {
    return BadInput("asset.version is '" + Printable(version) + "'; export as glTF 2.0");
  }
  GltfDocument result;
  result.binary = chunks.binary;
  TakeSources(document, result);
  GLINT_RETURN_IF_ERROR(ParseModel(document, result.model));
  return result;
}

Result<std::span<const std::byte>> GltfBytes::View(int64_t index) {
  const std::string object = "bufferViews[" + std::to_string(index) + "]";
  if (index < 0 || static_cast<size_t>(index) >= document_.model.bufferViews.size()) {
    return BadInput(object + ": there is no such buffer view; export the file again");
  }
  const tinygltf::BufferView& view = document_.model.bufferViews[index];
  auto buffer = Buffer(view.buffer);
  if (!buffer.ok()) return buffer.status().WithContext(object);
  const uint64_t size = buffer->size(), offset = view.byteOffset, length = view.byteLength;
  if (offset > size || length > size - offset) {
    return BadInput(object + ": bytes " + std::to_string(offset) + " to " + std::to_string(offset + length) +
                    " lie outside buffers[" + std::to_string(view.buffer) + "] of " + std::to_string(size) +
                    " bytes; export the file again");
  }
  return buffer->subspan(offset, length);
}

Result<std::span<const std::byte>> GltfBytes::Buffer(int64_t index) {
  const std::string object = "buffers[" + std::to_string(index) + "]";
  if (index < 0 || static_cast<size_t>(index) >= document_.buffers.size()) {
    return BadInput(object + ": there is no such buffer; export the file again");
  }
  const GltfDocument::BufferSource& source = document_.buffers[index];
  std::span<const std::byte> bytes = document_.binary;
  if (source.has_uri) {
    GLINT_ASSIGN_OR_RETURN(bytes, Uri(source.uri, object));
  } else if (index != 0 || bytes.empty()) {
    return BadInput(object + ": has no uri and the file has no binary chunk for it; export the file again");
  }
  if (bytes.size() < source.byte_length) {
    return BadInput(object + ": says " + std::to_string(source.byte_length) + " bytes but has " +
                    std::to_string(bytes.size()) + "; copy or export the file again");
  }
  return bytes.first(source.byte_length);
}

Result<std::span<const std::byte>> GltfBytes::Uri(const std::string& uri, const std::string& object) {
  if (const auto it = loaded_.find(uri); it != loaded_.end()) return std::span<const std::byte>(it->second);
  std::vector<std::byte> bytes;
  if (uri.rfind("data:", 0) == 0) {
    const std::string marker = ";base64,";
    const size_t comma = uri.find(marker);
    if (comma == std::string::npos || comma > 200) {
      return BadInput(object + ".uri: only base64 data URIs are supported; export with binary buffers");
    }
    auto decoded = DecodeBase64(std::string_view(uri).substr(comma + marker.size()));
    if (!decoded) return BadInput(object + ".uri: is not valid base64; export the file again");
    bytes = std::move(*decoded);
  } else {
    GLINT_ASSIGN_OR_RETURN(bytes, ReadBeside(uri, object));
  }
  return std::span<const std::byte>(loaded_.emplace(uri, std::move(bytes)).first->second);
}

Result<std::vector<std::byte>> GltfBytes::ReadBeside(const std::string& uri,
                                                     const std::string& object) const {
  const std::string name = DecodePercent(uri);
  if (!IsBeside(name)) {
    return BadInput(
        object + ".uri: '" + Printable(uri) +
        "' does not name a file beside the scene (no absolute paths, '..' or web addresses); put the "
        "file into the scene's folder or embed it");
  }
  if (folder_.empty()) {
    return BadInput(object + ".uri: '" + Printable(uri) +
                    "' is a separate file, which data in memory cannot have; "
                    "embed it");
  }
  // A link may still lead out of the folder.
  std::error_code error;
  const fs::path root = fs::canonical(folder_, error);
  if (error) return BadInput(object + ".uri: cannot open the scene's folder");
  const fs::path file = fs::canonical(root / name, error);
  if (error) return BadInput(object + ".uri: there is no file '" + Printable(name) + "' beside the scene");
  if (std::mismatch(root.begin(), root.end(), file.begin(), file.end()).first != root.end()) {
    return BadInput(object + ".uri: '" + Printable(uri) +
                    "' leads out of the scene's folder; copy the file into it");
  }
  auto bytes = ReadFile(file, max_bytes_);
  if (!bytes.ok()) return bytes.status().WithContext(object);
  return bytes;
}

}  // namespace glint
