#include "common/lobes/slice_quadrature.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <numbers>

namespace glint {
namespace {

using glm::dvec3;
constexpr double kPiD = std::numbers::pi;

// A direction and the density with which the warp of the unit square reaches it, 1/sr.
struct Point {
  dvec3 wi{0};
  double pdf = 0;
};

double Fifth(double x) { return x * x * (x * x * x); }

dvec3 Reflect(const dvec3& w, const dvec3& h) { return 2 * glm::dot(w, h) * h - w; }

// Visible normals (Heitz 2018), the azimuth over the half disc with t1 > 0.
Point WarpGgx(double alpha, const dvec3& wo, double u, double v) {
  const dvec3 stretched = glm::normalize(dvec3(alpha * wo.x, 0, wo.z));
  const dvec3 t1(0, 1, 0), t2 = glm::cross(stretched, t1);
  const double radius = std::sqrt(u), phi = kPiD * (v - 0.5), s = 0.5 * (1 + stretched.z);
  const double a = radius * std::cos(phi);
  const double b = (1 - s) * std::sqrt(1 - a * a) + s * radius * std::sin(phi);
  const dvec3 n = a * t1 + b * t2 + std::sqrt(std::max(0.0, 1 - a * a - b * b)) * stretched;
  const dvec3 h = glm::normalize(dvec3(alpha * n.x, alpha * n.y, std::max(0.0, n.z)));
  const double a2 = alpha * alpha, t = a2 * h.z * h.z + h.x * h.x + h.y * h.y;
  const double d = a2 / (kPiD * t * t);
  return {Reflect(wo, h), d / (2 * (wo.z + std::sqrt(a2 + (1 - a2) * wo.z * wo.z)))};
}

// Cosine power about an axis in the plane of incidence, the half with y > 0; density over that half doubled
// back.
Point WarpCosinePower(const dvec3& axis, double n, double u, double v) {
  const double log_cos = std::log(u) / (n + 1), one_minus_cos = -std::expm1(log_cos);
  const double sin_theta = std::sqrt(one_minus_cos * (2 - one_minus_cos)), phi = kPiD * (v - 0.5);
  const dvec3 side(0, 1, 0), up = glm::cross(axis, side);
  const dvec3 w =
      sin_theta * std::cos(phi) * side + sin_theta * std::sin(phi) * up + (1 - one_minus_cos) * axis;
  return {w, (n + 1) / (2 * kPiD) * std::exp(n * log_cos)};
}

Point Warp(BrdfModel model, double shape, const dvec3& wo, double u, double v) {
  switch (model) {
    case BrdfModel::kGgx: {
      const double roughness = std::clamp(shape, double{kMinRoughness}, 1.0);
      return WarpGgx(roughness * roughness, wo, u, v);
    }
    case BrdfModel::kPhong:
      return WarpCosinePower({-wo.x, 0, wo.z}, shape / 2, u, v);
    case BrdfModel::kBlinnPhong: {
      const Point h = WarpCosinePower({0, 0, 1}, shape / 2, u, v);
      const double cosine = glm::dot(wo, h.wi);
      if (cosine <= 0) return {};
      return {Reflect(wo, h.wi), h.pdf / (4 * cosine)};
    }
  }
  return {};
}

}  // namespace

SliceQuadrature MakeSliceQuadrature(BrdfModel model, float shape, double cos_o, int resolution) {
  const dvec3 wo(std::sqrt(1 - cos_o * cos_o), 0, cos_o);
  const Brdf unit{model, shape, glm::vec3(1), glm::vec3(0)};
  const double cell = 1.0 / (resolution * resolution);
  SliceQuadrature q;
  for (int i = 0; i < resolution; ++i)
    for (int j = 0; j < resolution; ++j) {
      const Point p = Warp(model, shape, wo, (i + 0.5) / resolution, (j + 0.5) / resolution);
      if (p.wi.z <= 0 || p.pdf <= 0) continue;
      const double value = EvaluateCosine(unit, wo, p.wi).x;
      q.x.push_back(p.wi.x);
      q.z.push_back(p.wi.z);
      q.weight.push_back(cell / p.pdf);
      q.root_weight.push_back(std::sqrt(q.weight.back()));
      q.value.push_back(value);
      q.schlick.push_back(Fifth(1 - std::sqrt(0.5 * (1 + std::min(1.0, glm::dot(wo, p.wi))))));
      q.albedo += q.weight.back() * value;
      q.norm2 += q.weight.back() * value * value;
    }
  return q;
}

}  // namespace glint
