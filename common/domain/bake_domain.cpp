#include "common/domain/bake_domain.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <map>
#include <utility>

#include "common/base/parallel.h"

namespace glint {
namespace {

using ShapeKey = std::pair<BrdfModel, float>;

/// A textured roughness takes values all over [0, 1]; rounding it keeps the number of fitted shapes small.
float RoundedShape(const Brdf& brdf, bool textured) {
  if (brdf.model != BrdfModel::kGgx || !textured) return brdf.shape;
  return std::max(std::round(brdf.shape / kRoughnessStep), 1.0f) * kRoughnessStep;
}

}  // namespace

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

  std::map<ShapeKey, uint16_t> shape_index;
  std::vector<ShapeKey> shapes;
  for (uint32_t v = 0; v < count; ++v) {
    const Material& material = scene.materials[scene.vertex_material[v]];
    const Brdf brdf = ToBrdf(EvaluateVertexMaterial(scene, v));
    const ShapeKey key{brdf.model, RoundedShape(brdf, material.metallic_roughness_texture != kNone)};
    const auto [it, added] = shape_index.try_emplace(key, static_cast<uint16_t>(shapes.size()));
    if (added) shapes.push_back(key);
    domain.shape[v] = it->second;
    domain.specular[v] = brdf.specular;
    domain.diffuse[v] = brdf.diffuse;
    domain.double_sided[v] = material.double_sided;
  }
  domain.shapes.resize(shapes.size());
  ParallelFor(shapes.size(), threads, 1, [&](size_t i, int) {
    domain.shapes[i] = FitBrdfShape(shapes[i].first, shapes[i].second, options);
  });
  return domain;
}

}  // namespace glint
