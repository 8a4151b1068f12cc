#include "tests/stability/stability_fixture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <utility>

#include "common/archive/lobe_codec.h"

namespace glint::stability {

void ExpectAtMost(const std::string& what, double value, double bound) {
  std::printf("[measured] %s: %.3g (bound %.3g)\n", what.c_str(), value, bound);
  EXPECT_LE(value, bound) << what;
}

std::string Short(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string NameOf(GatherMethod method) { return method == GatherMethod::kShared ? "shared" : "paper"; }

Material Lambert(const glm::vec3& albedo) {
  Material material;
  material.name = "lambert";
  material.model = MaterialModel::kPhong;
  material.exponent = 1;
  material.diffuse = albedo;
  return material;
}

Material Glossy(float exponent) {
  Material material = Lambert(glm::vec3(0.5f));
  material.name = "glossy";
  material.exponent = exponent;
  material.specular = glm::vec3(0.5f);
  return material;
}

Material Metal(float roughness, const glm::vec3& color) {
  Material material;
  material.name = "metal";
  material.base_color = color;
  material.roughness = roughness;
  return material;
}

Camera AnyCamera() { return {"main", {0, 0, 5}, {0, 0, -1}, {0, 1, 0}, 0.7f}; }

void AddBox(const glm::dvec3& low, const glm::dvec3& high, int rows, bool inwards, uint16_t material,
            MeshBuilder* builder) {
  const glm::dvec3 size = high - low;
  const glm::dvec3 edge[3] = {{size.x, 0, 0}, {0, size.y, 0}, {0, 0, size.z}};
  for (int k = 0; k < 3; ++k) {
    glm::dvec3 s = edge[(k + 1) % 3], t = edge[(k + 2) % 3];  // s x t points along +k
    if (!inwards) std::swap(s, t);
    builder->AddPatch(low, s, t, rows, rows, material);
    builder->AddPatch(low + edge[k], t, s, rows, rows, material);
  }
}

Scene FloorByWall(const std::vector<double>& x, const Material& material) {
  constexpr double kLong = 1000;
  MeshBuilder builder;
  const uint16_t m = builder.AddMaterial(material);
  builder.AddPatch({0, 0, kLong}, {0, 0, -2 * kLong}, {0, 1, 0}, 2, 2, m);
  const auto columns = static_cast<int>(x.size());
  const uint32_t first = builder.vertex_count();
  builder.AddPatch({0, 0, kLong}, {2, 0, 0}, {0, 0, -2 * kLong}, 3, columns, m);
  Scene scene = builder.Finish(AnyCamera());
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < columns; ++column)
      scene.positions[first + static_cast<uint32_t>(row * columns + column)].x =
          static_cast<float>(x[static_cast<size_t>(column)]);
  scene.content = HashScene(scene);
  return scene;
}

double FreeBesideWall(double x) { return 0.5 * (1 + x / std::sqrt(x * x + 1)); }

namespace {

BakeOptions ToOptions(const SmallBake& small) {
  BakeOptions options;
  options.settings.method = small.method;
  options.settings.grid_level = small.grid_level;
  options.settings.min_rays = small.rays;
  options.settings.max_rays = small.max_rays;
  options.settings.paper_rays = small.rays / 4;
  options.max_layers = small.layers;
  options.layer_tolerance = 0;
  options.threads = 1;
  return options;
}

}  // namespace

Baked::Baked(Scene scene, const SmallBake& options) : scene_(std::move(scene)), grid_(options.grid_level) {
  const auto path = folder_ / "out.glint";
  Result<BakeReport> report = BakeScene(scene_, "scene", path, ToOptions(options));
  EXPECT_TRUE(report.ok()) << report.status().message();
  const Status verified = VerifyArchive(path, 1);  // among others: every lobe is finite and within its range
  EXPECT_TRUE(verified.ok()) << verified.message();
  Result<Archive> archive = Archive::Open(path);
  EXPECT_TRUE(archive.ok()) << archive.status().message();
  if (!report.ok() || !archive.ok()) throw std::runtime_error("the scene cannot be baked and opened");
  report_ = std::move(report).value();
  archive_ = std::move(archive).value();
  reader_ = std::make_unique<TransferReader>(archive_->domain(), grid_);
}

double Baked::FreeDiffuse(uint32_t vertex) const {
  const SliceTableView& table = archive_->layers()[0].diffuse;
  const std::byte* entry = table.Find(vertex, 0);
  return entry ? DecodeDirect(entry, table.entry_bytes()).fraction : 1;
}

double Baked::FreeSpecular(uint32_t vertex, uint32_t column, int k) const {
  const SliceTableView& table = archive_->layers()[0].specular[static_cast<size_t>(k)];
  const std::byte* entry = table.Find(vertex, column);
  return entry ? DecodeDirect(entry, table.entry_bytes()).fraction : 1;
}

bool Baked::Defined(uint32_t vertex, uint32_t column) const {
  return glm::dot(domain().normals[vertex], grid_.direction(column)) > 0;
}

glm::vec3 Baked::Reflected(uint32_t triangle, float u, float v, const glm::vec3& wo, int layer) const {
  TransferPoint point;
  glm::vec3 radiance(0);
  if (!reader_->Prepare(triangle, u, v, wo, &point)) return radiance;
  LayerLobes lobes;
  reader_->Read(point, archive_->layers()[static_cast<size_t>(layer)], layer, &lobes);
  // A uniform sky filtered by any lobe is itself; so is the cosine lobe's sum of three.
  for (int i = 0; i < lobes.count; ++i) {
    const TransferLobe& lobe = lobes.lobe[i];
    EXPECT_TRUE(std::isfinite(lobe.kappa) && lobe.kappa >= 0) << "layer " << layer;
    EXPECT_NEAR(glm::length(lobe.mu), 1, 1e-4) << "layer " << layer;
    radiance += lobe.alpha;
  }
  return radiance;
}

glm::vec3 Baked::ReflectedAt(uint32_t vertex, const glm::vec3& wo, int layer) const {
  for (uint32_t t = 0; t < domain().triangles.size(); ++t) {
    const auto& corner = domain().triangles[t];
    for (int i = 0; i < 3; ++i)
      if (corner[static_cast<size_t>(i)] == vertex)
        return Reflected(t, i == 1 ? 1.0f : 0.0f, i == 2 ? 1.0f : 0.0f, wo, layer);
  }
  ADD_FAILURE() << "no triangle has vertex " << vertex;
  return glm::vec3(0);
}

double Baked::LargestFree() const {
  double largest = 0;
  const auto& shape_of = domain().shape;
  for (uint32_t v = 0; v < domain().vertex_count(); ++v) {
    const glm::vec3& diffuse = domain().diffuse[v];
    if (diffuse.x + diffuse.y + diffuse.z > 0) largest = std::max(largest, FreeDiffuse(v));
    for (uint32_t column = 0; column < grid_.size(); ++column)
      for (int k = 0; Defined(v, column) && k < domain().shapes[shape_of[v]].lobes; ++k)
        largest = std::max(largest, FreeSpecular(v, column, k));
  }
  return largest;
}

}  // namespace glint::stability
