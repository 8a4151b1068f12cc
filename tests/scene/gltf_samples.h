#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace glint::test {

using Bytes = std::vector<std::byte>;

/// A GLB of this document and binary chunk.
Bytes MakeGlb(const nlohmann::json& document, const Bytes& binary);

/// A document with one quad in the xy plane: positions, normals, uvs and 16-bit indices, one material, one
/// camera. `binary` gets its bytes. Buffer views and accessors 0 to 3: indices, positions, normals, uvs.
nlohmann::json QuadDocument(Bytes& binary);

/// Appends values to the binary chunk, aligned to 4; returns the index of their new buffer view.
template <class T>
size_t AddView(nlohmann::json& document, Bytes& binary, const std::vector<T>& values) {
  binary.resize((binary.size() + 3) / 4 * 4);
  const auto* bytes = reinterpret_cast<const std::byte*>(values.data());
  document["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", values.size() * sizeof(T)}});
  binary.insert(binary.end(), bytes, bytes + values.size() * sizeof(T));
  document["buffers"][0]["byteLength"] = binary.size();
  return document["bufferViews"].size() - 1;
}

/// The quad with its geometry compressed by Draco.
Bytes DracoQuad();
/// A 4 x 2 PNG: red, green, blue, white above black, black, black, black.
Bytes SmallPng();
/// The quad with SmallPng as base colour and metallic-roughness texture.
Bytes TexturedQuad();

/// Samples by file name, for fuzzing.
std::map<std::string, Bytes> AllSamples();

bool WriteBytes(const std::filesystem::path& path, const Bytes& bytes);

}  // namespace glint::test
