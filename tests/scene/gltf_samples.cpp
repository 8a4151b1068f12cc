#include "tests/scene/gltf_samples.h"

#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>

namespace glint::test {
namespace {

using nlohmann::json;

void Put(Bytes& out, uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<std::byte>(value >> shift));
}

void PutBig(Bytes& out, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::byte>(value >> shift));
}

void PutChunk(Bytes& png, const std::string& type, const Bytes& data) {
  PutBig(png, static_cast<uint32_t>(data.size()));
  Bytes body;
  for (const char c : type) body.push_back(static_cast<std::byte>(c));
  body.insert(body.end(), data.begin(), data.end());
  uint32_t crc = 0xFFFFFFFFu;
  for (const std::byte b : body) {
    crc ^= static_cast<uint32_t>(b);
    for (int k = 0; k < 8; ++k) crc = crc & 1 ? 0xEDB88320u ^ (crc >> 1) : crc >> 1;
  }
  png.insert(png.end(), body.begin(), body.end());
  PutBig(png, ~crc);
}

}  // namespace

Bytes MakeGlb(const json& document, const Bytes& binary) {
  std::string text = document.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const size_t padded = (binary.size() + 3) / 4 * 4;
  Bytes out;
  Put(out, 0x46546C67);
  Put(out, 2);
  Put(out, static_cast<uint32_t>(28 + text.size() + padded));
  Put(out, static_cast<uint32_t>(text.size()));
  Put(out, 0x4E4F534A);
  for (const char c : text) out.push_back(static_cast<std::byte>(c));
  Put(out, static_cast<uint32_t>(padded));
  Put(out, 0x004E4942);
  out.insert(out.end(), binary.begin(), binary.end());
  out.resize(28 + text.size() + padded);
  return out;
}

json QuadDocument(Bytes& binary) {
  json document = {{"asset", {{"version", "2.0"}}},
                   {"buffers", json::array({{{"byteLength", 0}}})},
                   {"bufferViews", json::array()}};
  AddView<uint16_t>(document, binary, {0, 1, 2, 0, 2, 3});
  AddView<float>(document, binary, {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
  AddView<float>(document, binary, {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  AddView<float>(document, binary, {0, 1, 1, 1, 1, 0, 0, 0});
  document["accessors"] = {{{"bufferView", 0}, {"componentType", 5123}, {"count", 6}, {"type", "SCALAR"}},
                           {{"bufferView", 1}, {"componentType", 5126}, {"count", 4}, {"type", "VEC3"}},
                           {{"bufferView", 2}, {"componentType", 5126}, {"count", 4}, {"type", "VEC3"}},
                           {{"bufferView", 3}, {"componentType", 5126}, {"count", 4}, {"type", "VEC2"}}};
  const json attributes = {{"POSITION", 1}, {"NORMAL", 2}, {"TEXCOORD_0", 3}};
  const json primitive = {{"attributes", attributes}, {"indices", 0}, {"material", 0}};
  document["meshes"] = json::array({{{"primitives", json::array({primitive})}}});
  document["materials"] = json::array(
      {{{"name", "metal"}, {"pbrMetallicRoughness", {{"metallicFactor", 1}, {"roughnessFactor", 0.5}}}}});
  document["cameras"] = json::array(
      {{{"type", "perspective"}, {"name", "main"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}}});
  document["nodes"] = {{{"mesh", 0}}, {{"camera", 0}, {"translation", {0, 0, 3}}}};
  document["scenes"] = json::array({{{"nodes", {0, 1}}}});
  document["scene"] = 0;
  return document;
}

Bytes DracoQuad() {
  const std::array<std::array<float, 3>, 4> corners = {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}};
  const std::array<std::array<int, 3>, 2> faces = {{{0, 1, 2}, {0, 2, 3}}};
  const std::array<float, 3> up = {0, 0, 1};
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(2);
  const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int normal = builder.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
  for (int f = 0; f < 2; ++f) {
    builder.SetAttributeValuesForFace(position, draco::FaceIndex(f), corners[faces[f][0]].data(),
                                      corners[faces[f][1]].data(), corners[faces[f][2]].data());
    builder.SetAttributeValuesForFace(normal, draco::FaceIndex(f), up.data(), up.data(), up.data());
  }
  const auto mesh = builder.Finalize();
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  draco::EncoderBuffer encoded;
  if (!mesh || !encoder.EncodeMeshToBuffer(*mesh, &encoded).ok()) return {};

  Bytes binary;
  json document = QuadDocument(binary);
  const size_t view =
      AddView(document, binary, std::vector<char>(encoded.data(), encoded.data() + encoded.size()));
  json& primitive = document["meshes"][0]["primitives"][0];
  primitive["attributes"] = {{"POSITION", 1}, {"NORMAL", 2}};
  primitive["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", view},
      {"attributes",
       {{"POSITION", mesh->attribute(position)->unique_id()},
        {"NORMAL", mesh->attribute(normal)->unique_id()}}}};
  // As compressors write it: accessors only describe, they have no data of their own.
  for (json& accessor : document["accessors"]) accessor.erase("bufferView");
  document["extensionsUsed"] = document["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return MakeGlb(document, binary);
}

Bytes SmallPng() {
  Bytes png;
  for (const int b : {0x89, 0x50, 0x4E, 0x47, 13, 10, 26, 10}) png.push_back(static_cast<std::byte>(b));
  Bytes header;
  PutBig(header, 4);
  PutBig(header, 2);
  for (const int b : {8, 2, 0, 0, 0}) header.push_back(static_cast<std::byte>(b));
  PutChunk(png, "IHDR", header);
  // Two rows of a filter byte and 4 RGB pixels, in a zlib stream of one stored block.
  const uint8_t rows[26] = {0, 255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
  Bytes data;
  for (const int b : {0x78, 0x01, 0x01, 26, 0, 0xFF - 26, 0xFF}) data.push_back(static_cast<std::byte>(b));
  uint32_t a = 1, b = 0;
  for (const uint8_t v : rows) {
    data.push_back(static_cast<std::byte>(v));
    a = (a + v) % 65521;
    b = (b + a) % 65521;
  }
  PutBig(data, (b << 16) | a);
  PutChunk(png, "IDAT", data);
  PutChunk(png, "IEND", {});
  return png;
}

Bytes TexturedQuad() {
  Bytes binary;
  json document = QuadDocument(binary);
  const size_t view = AddView(document, binary, SmallPng());
  document["images"] = json::array({{{"bufferView", view}, {"mimeType", "image/png"}}});
  document["samplers"] = json::array({{{"wrapS", 33071}, {"wrapT", 33071}}});
  document["textures"] = json::array({{{"source", 0}, {"sampler", 0}}});
  json& pbr = document["materials"][0]["pbrMetallicRoughness"];
  pbr["baseColorTexture"] = {{"index", 0}};
  pbr["metallicRoughnessTexture"] = {{"index", 0}};
  return MakeGlb(document, binary);
}

std::map<std::string, Bytes> AllSamples() {
  std::map<std::string, Bytes> samples;
  Bytes binary;
  json document = QuadDocument(binary);
  samples["quad.glb"] = MakeGlb(document, binary);
  document["nodes"] = {{{"mesh", 0}, {"scale", {-1, 1, 1}}}, {{"children", {0}}, {"rotation", {0, 0, 0, 1}}}};
  document["scenes"][0]["nodes"] = {1};
  document["materials"][0]["extras"]["glint_brdf"] = {
      {"model", "phong"}, {"exponent", 32}, {"specular", {0.9, 0.9, 0.9}}};
  const size_t sparse_index = AddView<uint16_t>(document, binary, {2});
  const size_t sparse_value = AddView<float>(document, binary, {2, 2, 0});
  document["accessors"][1]["sparse"] = {{"count", 1},
                                        {"indices", {{"bufferView", sparse_index}, {"componentType", 5123}}},
                                        {"values", {{"bufferView", sparse_value}}}};
  samples["sparse.glb"] = MakeGlb(document, binary);
  document["meshes"][0]["primitives"][0]["mode"] = 5;
  document["buffers"][0]["uri"] = "data:application/octet-stream;base64,AAAAAA==";
  const std::string text = document.dump();
  for (const char c : text) samples["strip.gltf"].push_back(static_cast<std::byte>(c));
  samples["textured.glb"] = TexturedQuad();
  samples["draco.glb"] = DracoQuad();
  return samples;
}

bool WriteBytes(const std::filesystem::path& path, const Bytes& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return file.good();
}

}  // namespace glint::test
