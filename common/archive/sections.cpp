#include "common/archive/sections.h"

#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>
#include <zstd.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>

#include "common/archive/format.h"
#include "common/base/frame.h"
#include "common/lobes/vmf.h"
#include "common/scene/bounds.h"

namespace glint::archive_format {
namespace {

static_assert(sizeof(glm::vec3) == 12 && sizeof(std::array<uint32_t, 3>) == 12,
              "arrays are stored as they lie");

constexpr uint64_t kVec3Bytes = 12;
constexpr float kMinAbove = 1e-7f;  ///< of a lobe; readers divide by it, and fits keep to 1e-6 or more
constexpr float kMaxWeight = 1e6f;  ///< of colours and lobes, which are 1 or little more: light stays finite

bool Finite(const glm::vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// Of directions that were made unit in single precision.
bool IsUnit(float length) { return std::abs(length - 1) <= 1e-3f; }

/// Appends values and arrays as they lie in memory.
class ByteWriter {
 public:
  template <class T>
  void Value(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    Bytes(&value, sizeof value);
  }
  template <class T>
  void Array(const std::vector<T>& values) {
    Bytes(values.data(), values.size() * sizeof(T));
  }
  std::vector<std::byte> Take() { return std::move(out_); }

 private:
  void Bytes(const void* data, size_t size) {
    const auto* p = static_cast<const std::byte*>(data);
    out_.insert(out_.end(), p, p + size);
  }
  std::vector<std::byte> out_;
};

/// Reads what ByteWriter wrote; reading past the end is remembered and gives zeros.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : rest_(bytes) {}

  template <class T>
  T Value() {
    static_assert(std::is_arithmetic_v<T>);
    T value{};
    Bytes(&value, sizeof value);
    return value;
  }
  /// Sizes `values` only after it is known that the bytes are there.
  template <class T>
  void Array(uint64_t count, std::vector<T>* values) {
    if (count > rest_.size() / sizeof(T)) {
      failed_ = true;
      return;
    }
    values->resize(count);
    Bytes(values->data(), count * sizeof(T));
  }
  uint64_t rest() const { return rest_.size(); }
  bool failed() const { return failed_; }
  /// Everything was there and nothing is left.
  bool Complete() const { return !failed_ && rest_.empty(); }

 private:
  void Bytes(void* out, size_t size) {
    if (size > rest_.size()) {
      failed_ = true;
      return;
    }
    if (size > 0) std::memcpy(out, rest_.data(), size);
    rest_ = rest_.subspan(size);
  }
  std::span<const std::byte> rest_;
  bool failed_ = false;
};

// ---- Geometry ----

std::unique_ptr<draco::PointAttribute> MakeAttribute(draco::GeometryAttribute::Type type,
                                                     const std::vector<glm::vec3>& values) {
  auto attribute = std::make_unique<draco::PointAttribute>();
  attribute->Init(type, 3, draco::DT_FLOAT32, false, values.size());
  attribute->SetIdentityMapping();
  for (uint32_t i = 0; i < values.size(); ++i) {
    attribute->SetAttributeValue(draco::AttributeValueIndex(i), &values[i].x);
  }
  return attribute;
}

void FillMesh(const BakeDomain& domain, draco::Mesh* mesh) {
  mesh->set_num_points(domain.vertex_count());
  mesh->AddAttribute(MakeAttribute(draco::GeometryAttribute::POSITION, domain.positions));
  mesh->AddAttribute(MakeAttribute(draco::GeometryAttribute::NORMAL, domain.normals));
  mesh->SetNumFaces(domain.triangles.size());
  for (uint32_t f = 0; f < domain.triangles.size(); ++f) {
    const auto& t = domain.triangles[f];
    mesh->SetFace(draco::FaceIndex(f),
                  {draco::PointIndex(t[0]), draco::PointIndex(t[1]), draco::PointIndex(t[2])});
  }
}

bool ReadVarint(std::span<const std::byte> bytes, size_t* at, uint64_t* value) {
  *value = 0;
  for (int shift = 0; shift < 35; shift += 7) {
    if (*at >= bytes.size()) return false;
    const auto byte = static_cast<uint64_t>(bytes[(*at)++]);
    *value |= (byte & 127) << shift;
    if (byte < 128) return true;
  }
  return false;
}

/// Draco sizes its arrays by what the stream says before it finds that the bytes are not there: looks at
/// those counts first. Sequential mesh, version 2.2: 11 bytes of header, then faces and points as varints.
bool DracoCountsAre(std::span<const std::byte> stored, uint64_t vertices, uint64_t triangles) {
  constexpr size_t kDracoHeader = 11;
  constexpr unsigned char kWanted[9] = {'D', 'R', 'A', 'C', 'O', 2, 2, 1, 0};  // version, mesh, sequential
  if (stored.size() < kDracoHeader || std::memcmp(stored.data(), kWanted, sizeof kWanted) != 0) return false;
  size_t at = kDracoHeader;
  uint64_t faces = 0, points = 0;
  return ReadVarint(stored, &at, &faces) && ReadVarint(stored, &at, &points) && faces == triangles &&
         points == vertices && stored.size() / (2 * kVec3Bytes) >= vertices && stored.size() / 3 >= triangles;
}

Status CopyAttribute(const draco::Mesh& mesh, draco::GeometryAttribute::Type type,
                     std::vector<glm::vec3>* out) {
  const draco::PointAttribute* attribute = mesh.GetNamedAttribute(type);
  if (attribute == nullptr || attribute->data_type() != draco::DT_FLOAT32 ||
      attribute->num_components() != 3) {
    return BadInput("an attribute is missing or not of three floats");
  }
  out->resize(mesh.num_points());
  for (uint32_t i = 0; i < mesh.num_points(); ++i) {
    const draco::AttributeValueIndex value = attribute->mapped_index(draco::PointIndex(i));
    if (value.value() >= attribute->size()) return BadInput("a vertex has no value");
    attribute->GetValue(value, &(*out)[i].x);
    if (!Finite((*out)[i])) return BadInput("a position or normal is not finite");
  }
  return {};
}

Status CopyMesh(const draco::Mesh& mesh, BakeDomain* domain) {
  GLINT_RETURN_IF_ERROR(CopyAttribute(mesh, draco::GeometryAttribute::POSITION, &domain->positions));
  GLINT_RETURN_IF_ERROR(CopyAttribute(mesh, draco::GeometryAttribute::NORMAL, &domain->normals));
  for (size_t v = 0; v < domain->positions.size(); ++v) {
    if (!Within(domain->positions[v], kMaxCoordinate)) return BadInput("a position is beyond 1e15");
    if (!IsUnit(glm::length(domain->normals[v]))) return BadInput("a normal is not of unit length");
  }
  domain->triangles.resize(mesh.num_faces());
  for (uint32_t f = 0; f < mesh.num_faces(); ++f) {
    const draco::Mesh::Face& face = mesh.face(draco::FaceIndex(f));
    for (int corner = 0; corner < 3; ++corner) {
      if (face[corner].value() >= mesh.num_points()) return BadInput("a triangle's vertex is out of range");
      domain->triangles[f][corner] = face[corner].value();
    }
  }
  return {};
}

// ---- Shapes ----

/// Calls visit(field) for every number of a lobe, in the order of the format.
template <class Lobe, class Visit>
void VisitLobe(Lobe& lobe, const Visit& visit) {
  visit(lobe.mu_x);
  visit(lobe.mu_z);
  visit(lobe.kappa);
  visit(lobe.scale);
  visit(lobe.bias);
  visit(lobe.above);
}
static_assert(sizeof(BrdfLobe) == 6 * sizeof(float) && sizeof(BrdfFitError) == 4 * sizeof(float),
              "a field was added: store it, and raise kVersion");

template <class Error, class Visit>
void VisitError(Error& error, const Visit& visit) {
  visit(error.mean_l2);
  visit(error.max_l2);
  visit(error.max_albedo);
  visit(error.max_below_horizon);
}

Status DecodeSlice(int shape_lobes, ByteReader* in, BrdfSlice* slice) {
  slice->lobes = static_cast<int>(in->Value<uint32_t>());
  if (slice->lobes < 0 || slice->lobes > shape_lobes) return BadInput("lobe count out of range");
  bool finite = true;
  for (BrdfLobe& lobe : slice->lobe) {
    VisitLobe(lobe, [&](float& field) {
      field = in->Value<float>();
      finite = finite && std::isfinite(field);
    });
    if (!finite || lobe.kappa < 0 || lobe.kappa > kMaxKappa || lobe.above < kMinAbove || lobe.above > 1 ||
        std::abs(lobe.scale) > kMaxWeight || std::abs(lobe.bias) > kMaxWeight ||
        !IsUnit(std::hypot(lobe.mu_x, lobe.mu_z)))
      return BadInput("a lobe is out of range");
  }
  return {};
}

Status DecodeShape(ByteReader* in, BrdfShape* shape) {
  const auto model = in->Value<uint32_t>();
  if (model > static_cast<uint32_t>(BrdfModel::kBlinnPhong)) return BadInput("unknown BRDF model");
  shape->model = static_cast<BrdfModel>(model);
  shape->shape = in->Value<float>();
  shape->lobes = static_cast<int>(in->Value<uint32_t>());
  if (!std::isfinite(shape->shape) || shape->lobes < 0 || shape->lobes > kMaxBrdfLobes) {
    return BadInput("lobe count or roughness out of range");
  }
  bool finite = true;
  VisitError(shape->error, [&](float& field) {
    field = in->Value<float>();
    finite = finite && std::isfinite(field);
  });
  if (!finite) return BadInput("a fit's error is not finite");
  if (in->Value<uint32_t>() != static_cast<uint32_t>(kElevationNodes))
    return BadInput("wrong number of elevations");
  shape->slices.resize(kElevationNodes);
  for (BrdfSlice& slice : shape->slices) GLINT_RETURN_IF_ERROR(DecodeSlice(shape->lobes, in, &slice));
  return {};
}

void EncodeShape(const BrdfShape& shape, ByteWriter* out) {
  out->Value(static_cast<uint32_t>(shape.model));
  out->Value(shape.shape);
  out->Value(static_cast<uint32_t>(shape.lobes));
  VisitError(shape.error, [&](const float& field) { out->Value(field); });
  out->Value(static_cast<uint32_t>(shape.slices.size()));
  for (const BrdfSlice& slice : shape.slices) {
    out->Value(static_cast<uint32_t>(slice.lobes));
    for (const BrdfLobe& lobe : slice.lobe) VisitLobe(lobe, [&](const float& field) { out->Value(field); });
  }
}

// ---- Cameras ----

nlohmann::json ToJson(const glm::vec3& v) { return nlohmann::json::array({v.x, v.y, v.z}); }

bool FromJson(const nlohmann::json& json, glm::vec3* v) {
  if (!json.is_array() || json.size() != 3) return false;
  for (int i = 0; i < 3; ++i) {
    if (!json[i].is_number()) return false;
    (*v)[i] = json[i].get<float>();
  }
  return Finite(*v);
}

/// What a view of the camera needs.
bool Usable(const Camera& camera) {
  return Within(camera.eye, kMaxEye) && Finite(camera.forward) && Finite(camera.up) &&
         camera.vertical_fov > 0 && camera.vertical_fov < kPi;
}

bool FromJson(const nlohmann::json& json, Camera* camera) {
  if (!json.is_object()) return false;
  for (const char* key : {"name", "eye", "forward", "up", "vertical_fov"}) {
    if (!json.contains(key)) return false;
  }
  if (!json["name"].is_string() || !json["vertical_fov"].is_number()) return false;
  camera->name = json["name"].get<std::string>();
  camera->vertical_fov = json["vertical_fov"].get<float>();
  return FromJson(json["eye"], &camera->eye) && FromJson(json["forward"], &camera->forward) &&
         FromJson(json["up"], &camera->up) && Usable(*camera);
}

}  // namespace

Result<std::vector<std::byte>> EncodeGeometry(const BakeDomain& domain) {
  if (domain.positions.empty() && domain.triangles.empty()) return std::vector<std::byte>();
  try {
    draco::Mesh mesh;
    FillMesh(domain, &mesh);
    draco::ExpertEncoder encoder(mesh);
    encoder.SetEncodingMethod(draco::MESH_SEQUENTIAL_ENCODING);
    draco::EncoderBuffer buffer;
    const draco::Status status = encoder.EncodeToBuffer(&buffer);
    if (!status.ok()) return InternalError(std::string("geometry: Draco: ") + status.error_msg());
    const auto* data = reinterpret_cast<const std::byte*>(buffer.data());
    return std::vector<std::byte>(data, data + buffer.size());
  } catch (const std::exception& e) {
    return InternalError(std::string("geometry: Draco: ") + e.what());
  }
}

Status DecodeGeometry(std::span<const std::byte> stored, uint64_t vertices, uint64_t triangles,
                      BakeDomain* domain) {
  if (vertices == 0 && triangles == 0 && stored.empty()) return {};
  if (!DracoCountsAre(stored, vertices, triangles)) return BadInput("its counts are not the header's");
  try {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(stored.data()), stored.size());
    draco::Decoder decoder;
    auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
    if (!mesh.ok()) return BadInput(std::string("Draco: ") + mesh.status().error_msg());
    if (mesh.value()->num_points() != vertices || mesh.value()->num_faces() != triangles) {
      return BadInput("its counts are not the header's");
    }
    return CopyMesh(*mesh.value(), domain);
  } catch (const std::exception& e) {
    return BadInput(std::string("Draco: ") + e.what());
  }
}

uint64_t VertexSectionBytes(uint64_t vertices, uint64_t triangles) {
  return vertices * (2 * kVec3Bytes + 2 + 1) + triangles;
}

std::vector<std::byte> EncodeVertices(const BakeDomain& domain) {
  ByteWriter out;
  out.Array(domain.specular);
  out.Array(domain.diffuse);
  out.Array(domain.shape);
  out.Array(domain.double_sided);
  out.Array(domain.triangle_double_sided);
  return out.Take();
}

Status DecodeVertices(std::span<const std::byte> raw, BakeDomain* domain) {
  ByteReader in(raw);
  const uint64_t vertices = domain->positions.size(), triangles = domain->triangles.size();
  in.Array(vertices, &domain->specular);
  in.Array(vertices, &domain->diffuse);
  in.Array(vertices, &domain->shape);
  in.Array(vertices, &domain->double_sided);
  in.Array(triangles, &domain->triangle_double_sided);
  if (!in.Complete()) return BadInput("wrong size");
  for (uint64_t v = 0; v < vertices; ++v) {
    if (!Within(domain->specular[v], kMaxWeight) || !Within(domain->diffuse[v], kMaxWeight))
      return BadInput("a colour is out of range");
    if (domain->shape[v] >= domain->shapes.size()) return BadInput("a vertex's shape is out of range");
    if (domain->double_sided[v] > 1) return BadInput("a flag is neither 0 nor 1");
  }
  for (const uint8_t flag : domain->triangle_double_sided) {
    if (flag > 1) return BadInput("a flag is neither 0 nor 1");
  }
  return {};
}

std::vector<std::byte> EncodeShapes(const std::vector<BrdfShape>& shapes) {
  ByteWriter out;
  out.Value(static_cast<uint32_t>(shapes.size()));
  for (const BrdfShape& shape : shapes) EncodeShape(shape, &out);
  return out.Take();
}

Status DecodeShapes(std::span<const std::byte> raw, std::vector<BrdfShape>* shapes) {
  ByteReader in(raw);
  const auto count = in.Value<uint32_t>();
  if (count > 65536) return BadInput("more shapes than a vertex can name");
  for (uint32_t i = 0; i < count && !in.failed(); ++i) {
    GLINT_RETURN_IF_ERROR(
        DecodeShape(&in, &shapes->emplace_back()).WithContext("shape " + std::to_string(i)));
  }
  if (!in.Complete()) return BadInput("wrong size");
  return {};
}

Result<std::vector<std::byte>> EncodeCameras(const std::vector<Camera>& cameras) {
  nlohmann::json list = nlohmann::json::array();
  for (const Camera& camera : cameras) {
    if (!Usable(camera)) return InternalError("camera \"" + camera.name + "\" is out of range");
    list.push_back({{"name", camera.name},
                    {"eye", ToJson(camera.eye)},
                    {"forward", ToJson(camera.forward)},
                    {"up", ToJson(camera.up)},
                    {"vertical_fov", camera.vertical_fov}});
  }
  // A name that is not UTF-8 gets replacement characters rather than failing the bake at its end.
  const std::string text = list.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return std::vector<std::byte>(data, data + text.size());
}

Status DecodeCameras(std::span<const std::byte> raw, std::vector<Camera>* cameras) {
  try {
    const auto* text = reinterpret_cast<const char*>(raw.data());
    const nlohmann::json list = nlohmann::json::parse(text, text + raw.size(), nullptr, false);
    if (!list.is_array()) return BadInput("not a JSON array");
    for (const nlohmann::json& json : list) {
      if (!FromJson(json, &cameras->emplace_back()))
        return BadInput("a camera lacks a field or has a wrong one");
    }
    return {};
  } catch (const std::exception& e) {
    return BadInput(e.what());
  }
}

Result<std::vector<std::byte>> Compress(std::span<const std::byte> raw) {
  constexpr int kLevel = 9;
  std::vector<std::byte> out(ZSTD_compressBound(raw.size()));
  const size_t size = ZSTD_compress(out.data(), out.size(), raw.data(), raw.size(), kLevel);
  if (ZSTD_isError(size)) return InternalError(std::string("zstd: ") + ZSTD_getErrorName(size));
  out.resize(size);
  return out;
}

Result<std::vector<std::byte>> Decompress(std::span<const std::byte> stored, uint64_t raw_bytes) {
  if (ZSTD_getFrameContentSize(stored.data(), stored.size()) != raw_bytes) {
    return BadInput("its declared size is not the footer's");
  }
  std::vector<std::byte> raw(raw_bytes);
  const size_t size = ZSTD_decompress(raw.data(), raw.size(), stored.data(), stored.size());
  if (ZSTD_isError(size)) return BadInput(std::string("zstd: ") + ZSTD_getErrorName(size));
  if (size != raw_bytes) return BadInput("it is shorter than declared");
  return raw;
}

}  // namespace glint::archive_format
