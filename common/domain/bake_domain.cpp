#include "common/domain/bake_domain.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "common/base/log.h"
#include "common/base/parallel.h"

namespace glint {
namespace {

using ShapeKey = std::pair<BrdfModel, float>;

/// The shape of a multiple of kRoughnessStep: at most 64 of each model. An exponent is rounded as the
/// roughness about as wide, (2 / (n + 2))^(1/4).
float RoundedShape(BrdfModel model, float shape) {
  const float roughness = model == BrdfModel::kGgx ? shape : std::pow(2 / (shape + 2), 0.25f);
  const float rounded = std::max(std::round(roughness / kRoughnessStep), 1.0f) * kRoughnessStep;
  return model == BrdfModel::kGgx ? rounded : 2 / (rounded * rounded * rounded * rounded) - 2;
}

/// Makes few of many shapes: each distinct one is fitted and stored, and a vertex names it by 16 bits.
void LimitShapes(std::vector<ShapeKey>& shape_of_vertex, std::vector<std::string>* notes) {
  const std::set<ShapeKey> distinct(shape_of_vertex.begin(), shape_of_vertex.end());
  if (distinct.size() <= kMaxExactShapes) return;
  std::map<ShapeKey, ShapeKey> rounded;
  for (const ShapeKey& key : distinct) rounded[key] = {key.first, RoundedShape(key.first, key.second)};
  for (ShapeKey& key : shape_of_vertex) key = rounded[key];
  notes->push_back("the scene has " + std::to_string(distinct.size()) +
                   " different roughnesses and exponents; they are rounded to steps of 1/64 in roughness");
  Log(LogLevel::kNote, notes->back());
}

}  // namespace

glm::vec3 BakeDomain::FaceNormal(uint32_t triangle) const {
  const auto& t = triangles[triangle];
  const glm::dvec3 p(positions[t[0]]);
  const glm::dvec3 cross = glm::cross(glm::dvec3(positions[t[1]]) - p, glm::dvec3(positions[t[2]]) - p);
  const double length = glm::length(cross);
  return length > 0 ? glm::vec3(cross / length) : glm::vec3(0);
}

BakeVertex BakeDomain::Node(uint32_t node) const {
  if (node < vertex_count())
    return {node, normals[node], shape[node], double_sided[node] != 0, specular[node], diffuse[node]};
  const SurfacePlace& place = nodes.facets.middles()[node - vertex_count()].place;
  const auto& t = triangles[place.triangle];
  const float w[3] = {1 - place.u - place.v, place.u, place.v};
  glm::vec3 normal(0), ks(0), kd(0);
  int nearest = 0;
  for (int i = 0; i < 3; ++i) {
    normal += w[i] * normals[t[i]];
    ks += w[i] * specular[t[i]];
    kd += w[i] * diffuse[t[i]];
    if (w[i] > w[nearest]) nearest = i;
  }
  const float length = glm::length(normal);
  return {node,
          length > 1e-10f ? normal / length : FaceNormal(place.triangle),
          shape[t[nearest]],
          triangle_double_sided[place.triangle] != 0,
          ks,
          kd};
}

glm::vec3 BakeDomain::NodePosition(uint32_t node) const {
  if (node < vertex_count()) return positions[node];
  const SurfacePlace& place = nodes.facets.middles()[node - vertex_count()].place;
  const auto& t = triangles[place.triangle];
  return (1 - place.u - place.v) * positions[t[0]] + place.u * positions[t[1]] + place.v * positions[t[2]];
}

Brdf ToBrdf(const SurfacePoint& point) {
  Brdf brdf;
  if (point.model == MaterialModel::kMetallicRoughness) {
    brdf.model = BrdfModel::kGgx;
    brdf.shape = std::max(point.roughness, kMinRoughness);
    brdf.specular = glm::mix(glm::vec3(0.04f), point.base_color, point.metallic);
    brdf.diffuse = point.base_color * (1 - point.metallic);
  } else {
    brdf.model = point.model == MaterialModel::kPhong ? BrdfModel::kPhong : BrdfModel::kBlinnPhong;
    brdf.shape = point.exponent;
    brdf.specular = point.specular;
    brdf.diffuse = point.diffuse;
  }
  return brdf;
}

int BakeDomain::max_lobes() const {
  int lobes = 0;
  for (const BrdfShape& s : shapes) lobes = std::max(lobes, s.lobes);
  return lobes;
}

bool BakeDomain::has_diffuse() const {
  return std::any_of(diffuse.begin(), diffuse.end(), [](const glm::vec3& d) { return d.x + d.y + d.z > 0; });
}

BakeDomain BuildBakeDomain(const Scene& scene, const BrdfFitOptions& options, int threads) {
  BakeDomain domain;
  domain.positions = scene.positions;
  domain.normals = scene.normals;
  domain.triangles = scene.triangles;
  const size_t count = scene.positions.size();
  domain.specular.resize(count);
  domain.diffuse.resize(count);
  domain.shape.resize(count);
  domain.double_sided.resize(count);
  domain.triangle_double_sided.resize(scene.triangles.size());
  for (size_t t = 0; t < scene.triangles.size(); ++t)
    domain.triangle_double_sided[t] = scene.materials[scene.triangle_material[t]].double_sided;

  std::vector<ShapeKey> shape_of_vertex(count);
  for (uint32_t v = 0; v < count; ++v) {
    const Material& material = scene.materials[scene.vertex_material[v]];
    const Brdf brdf = ToBrdf(EvaluateVertexMaterial(scene, v));
    const bool textured = material.metallic_roughness_texture != kNone;
    shape_of_vertex[v] = {brdf.model, textured && brdf.model == BrdfModel::kGgx
                                          ? RoundedShape(brdf.model, brdf.shape)
                                          : brdf.shape};
    domain.specular[v] = brdf.specular;
    domain.diffuse[v] = brdf.diffuse;
    domain.double_sided[v] = material.double_sided;
  }
  LimitShapes(shape_of_vertex, &domain.notes);

  std::map<ShapeKey, uint16_t> shape_index;
  std::vector<ShapeKey> shapes;
  for (uint32_t v = 0; v < count; ++v) {
    const auto [it, added] =
        shape_index.try_emplace(shape_of_vertex[v], static_cast<uint16_t>(shapes.size()));
    if (added) shapes.push_back(shape_of_vertex[v]);
    domain.shape[v] = it->second;
  }
  domain.shapes.resize(shapes.size());
  ParallelFor(shapes.size(), threads, 1, [&](size_t i, int) {
    domain.shapes[i] = FitBrdfShape(shapes[i].first, shapes[i].second, options);
  });
  return domain;
}

}  // namespace glint
