#include "common/scene/gltf_draco.h"

#include <draco/compression/decode.h>
#include <draco/core/decoder_buffer.h>
#include <draco/mesh/mesh.h>

#include <cmath>
#include <exception>
#include <memory>
#include <optional>
#include <utility>

namespace glint {
namespace {

// More triangles a byte than any real mesh has: beyond this, small data asks for much memory.
constexpr uint64_t kMaxTrianglesPerByte = 4096;

// Reads the start of Draco's bitstream (version 2.2): "DRACO", version, geometry, method, flags, then the
// counts.
class HeaderReader {
 public:
  explicit HeaderReader(std::span<const std::byte> data) : data_(data) {}
  uint8_t Byte() {
    if (at_ >= data_.size()) {
      failed_ = true;
      return 0;
    }
    return static_cast<uint8_t>(data_[at_++]);
  }
  uint64_t Varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const uint8_t byte = Byte();
      value |= uint64_t(byte & 0x7F) << shift;
      if (!(byte & 0x80)) return value;
    }
    failed_ = true;
    return 0;
  }
  bool failed() const { return failed_; }

 private:
  std::span<const std::byte> data_;
  size_t at_ = 0;
  bool failed_ = false;
};

Status CheckHeader(std::span<const std::byte> data, uint64_t max_points, uint64_t max_triangles,
                   const std::string& object) {
  const Status broken = BadInput(object + ": is not Draco mesh data; export the file again");
  HeaderReader header(data);
  for (const char c : {'D', 'R', 'A', 'C', 'O'}) {
    if (header.Byte() != static_cast<uint8_t>(c)) return broken;
  }
  const uint8_t major = header.Byte(), minor = header.Byte(), geometry = header.Byte(),
                method = header.Byte();
  const uint8_t flags_low = header.Byte(), flags_high = header.Byte();
  if (header.failed() || geometry != 1 || method > 1) return broken;
  if (major != 2 || minor != 2) {
    return BadInput(object + ": Draco bitstream " + std::to_string(major) + "." + std::to_string(minor) +
                    " is not supported; compress again with a current encoder (2.2)");
  }
  if (flags_low != 0 || flags_high != 0) {
    return BadInput(object + ": Draco metadata is not supported; compress again without it");
  }
  // Sequential: faces, points. Edgebreaker: kind of traversal, vertices, faces.
  if (method == 1) header.Byte();
  const uint64_t first = header.Varint(), second = header.Varint();
  if (header.failed()) return broken;
  const uint64_t points = method == 1 ? first : second, triangles = method == 1 ? second : first;
  if (points > max_points || triangles > max_triangles || triangles > data.size() * kMaxTrianglesPerByte ||
      points > data.size() * kMaxTrianglesPerByte) {
    return LimitExceeded(object + ": claims " + std::to_string(points) + " points and " +
                         std::to_string(triangles) + " triangles, beyond the limits; simplify the scene");
  }
  return {};
}

std::optional<FloatArray> ReadAttribute(const draco::Mesh& mesh, const draco::PointAttribute& attribute,
                                        bool normalize) {
  FloatArray array;
  array.components = attribute.num_components();
  if (array.components < 1 || array.components > 4) return std::nullopt;
  array.values.resize(size_t{mesh.num_points()} * array.components);
  float scale = 1;
  if (normalize && !attribute.normalized()) {
    if (attribute.data_type() == draco::DT_UINT8) scale = 1 / 255.0f;
    if (attribute.data_type() == draco::DT_INT8) scale = 1 / 127.0f;
    if (attribute.data_type() == draco::DT_UINT16) scale = 1 / 65535.0f;
    if (attribute.data_type() == draco::DT_INT16) scale = 1 / 32767.0f;
  }
  for (uint32_t i = 0; i < mesh.num_points(); ++i) {
    const draco::AttributeValueIndex value = attribute.mapped_index(draco::PointIndex(i));
    if (value.value() >= attribute.size()) return std::nullopt;
    float v[4] = {0, 0, 0, 0};
    if (!attribute.ConvertValue<float>(value, static_cast<int8_t>(array.components), v)) return std::nullopt;
    for (int c = 0; c < array.components; ++c) {
      if (!std::isfinite(v[c])) return std::nullopt;
      array.values[size_t{i} * array.components + c] = v[c] * scale;
    }
  }
  return array;
}

Result<DracoMesh> Decode(std::span<const std::byte> data, const std::map<std::string, int>& ids,
                         const std::map<std::string, bool>& normalize, uint64_t max_points,
                         uint64_t max_triangles, const std::string& object) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok() || !decoded.value()) {
    return BadInput(object + ": Draco cannot decode the mesh (" +
                    Printable(decoded.status().error_msg_string()) + "); export the file again");
  }
  const std::unique_ptr<draco::Mesh> mesh = std::move(decoded).value();
  if (mesh->num_points() > max_points || mesh->num_faces() > max_triangles) {
    return LimitExceeded(object + ": has more points or triangles than the limits allow; simplify the scene");
  }
  DracoMesh result;
  result.points = mesh->num_points();
  result.indices.reserve(size_t{mesh->num_faces()} * 3);
  for (uint32_t face = 0; face < mesh->num_faces(); ++face) {
    for (const draco::PointIndex& point : mesh->face(draco::FaceIndex(face))) {
      if (point.value() >= result.points) return BadInput(object + ": a Draco index is out of range");
      result.indices.push_back(point.value());
    }
  }
  for (const auto& [name, id] : ids) {
    const draco::PointAttribute* attribute = mesh->GetAttributeByUniqueId(static_cast<uint32_t>(id));
    const auto flag = normalize.find(name);
    auto array = attribute ? ReadAttribute(*mesh, *attribute, flag != normalize.end() && flag->second)
                           : std::optional<FloatArray>();
    if (!array) {
      return BadInput(object + ".attributes." + Printable(name) +
                      ": the Draco data has no usable attribute of that id; export the file again");
    }
    result.attributes.emplace(name, std::move(*array));
  }
  return result;
}

}  // namespace

Result<DracoMesh> DecodeDraco(std::span<const std::byte> data, const std::map<std::string, int>& ids,
                              const std::map<std::string, bool>& normalize, uint64_t max_points,
                              uint64_t max_triangles, const std::string& object) {
  GLINT_RETURN_IF_ERROR(CheckHeader(data, max_points, max_triangles, object));
  try {
    return Decode(data, ids, normalize, max_points, max_triangles, object);
  } catch (const std::exception&) {
    return BadInput(object + ": Draco cannot decode the mesh; export the file again");
  }
}

}  // namespace glint
