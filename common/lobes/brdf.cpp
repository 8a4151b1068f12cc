// glTF 2.0 Appendix B (GGX, separable Smith, Schlick), Phong (Lafortune and Willems 1994) and Blinn-Phong
// with the normalisation that keeps the albedo at normal incidence at one. Deviations from the mirror
// direction or the normal are taken from coordinate differences, never from 1 - cos, so that sharp lobes keep
// their shape in float.

#include "common/lobes/brdf.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"

namespace glint {
namespace {

float Alpha(float roughness) {
  const float r = std::clamp(roughness, kMinRoughness, 1.0f);
  return r * r;
}

float Fifth(float x) { return x * x * (x * x * x); }

// c + sqrt(a^2 + (1 - a^2) c^2): Smith's G1 is 2 c over this.
float SmithDenominator(float alpha, float c) {
  const float a2 = alpha * alpha;
  return c + std::sqrt(a2 + (1 - a2) * c * c);
}

float GgxD(float alpha, const glm::vec3& h) {
  const float a2 = alpha * alpha;
  const float t = a2 * h.z * h.z + h.x * h.x + h.y * h.y;
  return a2 / (kPi * t * t);
}

// cos^n of the angle between unit vectors a and b, 0 beyond a right angle.
float CosinePower(const glm::vec3& a, const glm::vec3& b, float n) {
  const glm::vec3 chord = a - b;
  const float one_minus_cos = 0.5f * glm::dot(chord, chord);
  return one_minus_cos < 1 ? std::exp(n * std::log1p(-one_minus_cos)) : 0;
}

glm::vec3 Mirror(const glm::vec3& w) { return {-w.x, -w.y, w.z}; }

constexpr glm::vec3 kNormal{0, 0, 1};

// The specular part times cos_i at Fresnel factor one.
float SpecularCosine(const Brdf& brdf, const glm::vec3& wo, const glm::vec3& wi, const glm::vec3& h) {
  const float n = brdf.shape;
  switch (brdf.model) {
    case BrdfModel::kGgx: {
      const float alpha = Alpha(n);
      return GgxD(alpha, h) * wi.z / (SmithDenominator(alpha, wo.z) * SmithDenominator(alpha, wi.z));
    }
    case BrdfModel::kPhong:
      return (n + 2) / (2 * kPi) * CosinePower(Mirror(wo), wi, n) * wi.z;
    case BrdfModel::kBlinnPhong:
      return (n + 2) * ((n + 4) / (8 * kPi * (std::exp2(-n / 2) + n))) * CosinePower(h, kNormal, n) * wi.z;
  }
  return 0;
}

// Density of the specular sampler, 1/sr: visible normals (Heitz 2018), or the cosine power about mirror or
// normal.
float SpecularPdf(const Brdf& brdf, const glm::vec3& wo, const glm::vec3& wi, const glm::vec3& h) {
  const float n = brdf.shape;
  switch (brdf.model) {
    case BrdfModel::kGgx: {
      const float alpha = Alpha(n);
      return GgxD(alpha, h) / (2 * SmithDenominator(alpha, wo.z));
    }
    case BrdfModel::kPhong:
      return (n + 1) / (2 * kPi) * CosinePower(Mirror(wo), wi, n);
    case BrdfModel::kBlinnPhong:
      return (n + 1) / (8 * kPi * glm::dot(wo, h)) * CosinePower(h, kNormal, n);
  }
  return 0;
}

// A normal that wo sees, proportional to the area it shows: stretch to alpha = 1, a disc warped to the
// visible half-sphere's outline, back (Heitz 2018).
glm::vec3 SampleVisibleNormal(float alpha, const glm::vec3& wo, float u, float v) {
  const glm::vec3 stretched = glm::normalize(glm::vec3(alpha * wo.x, alpha * wo.y, wo.z));
  const float length = std::hypot(stretched.x, stretched.y);
  const glm::vec3 t1 = length > 1e-7f ? glm::vec3(-stretched.y, stretched.x, 0) / length : glm::vec3(1, 0, 0);
  const glm::vec3 t2 = glm::cross(stretched, t1);
  const float radius = std::sqrt(u), phi = 2 * kPi * v, s = 0.5f * (1 + stretched.z);
  const float a = radius * std::cos(phi);
  const float b = (1 - s) * std::sqrt(std::max(0.0f, 1 - a * a)) + s * radius * std::sin(phi);
  const glm::vec3 n = a * t1 + b * t2 + std::sqrt(std::max(0.0f, 1 - a * a - b * b)) * stretched;
  return glm::normalize(glm::vec3(alpha * n.x, alpha * n.y, std::max(1e-7f, n.z)));
}

// Direction at which cos^(n+1) has fallen to u, about `axis`.
glm::vec3 SampleCosinePower(const glm::vec3& axis, float n, float u, float v) {
  const float one_minus_cos = -std::expm1(std::log(u) / (n + 1));
  const float sin_theta = std::sqrt(std::max(0.0f, one_minus_cos * (2 - one_minus_cos))), phi = 2 * kPi * v;
  const glm::vec3 local{sin_theta * std::cos(phi), sin_theta * std::sin(phi), 1 - one_minus_cos};
  return glm::normalize(Frame::FromNormal(axis).ToWorld(local));
}

glm::vec3 Reflect(const glm::vec3& w, const glm::vec3& h) {
  return glm::normalize(2 * glm::dot(w, h) * h - w);
}

glm::vec3 SampleSpecular(const Brdf& brdf, const glm::vec3& wo, float u, float v) {
  switch (brdf.model) {
    case BrdfModel::kGgx:
      return Reflect(wo, SampleVisibleNormal(Alpha(brdf.shape), wo, u, v));
    case BrdfModel::kPhong:
      return SampleCosinePower(Mirror(wo), brdf.shape, u, v);
    case BrdfModel::kBlinnPhong: {
      const glm::vec3 h = SampleCosinePower(kNormal, brdf.shape, u, v);
      return glm::dot(wo, h) > 0 ? Reflect(wo, h) : glm::vec3(0);
    }
  }
  return glm::vec3(0);
}

glm::vec3 SampleCosine(float u, float v) {
  const float radius = std::sqrt(u), phi = 2 * kPi * v;
  return {radius * std::cos(phi), radius * std::sin(phi), std::sqrt(std::max(0.0f, 1 - u))};
}

// Probability of the specular sampler: by what the two parts reflect, and some of each where both exist.
float SpecularProbability(const Brdf& brdf, const glm::vec3& wo) {
  const bool ggx = brdf.model == BrdfModel::kGgx;
  const float schlick = ggx ? Fifth(1 - std::clamp(wo.z, 0.0f, 1.0f)) : 0;
  const float specular = Luminance(brdf.specular + schlick * (glm::vec3(1) - brdf.specular));
  const float diffuse = Luminance(brdf.diffuse) * (1 - schlick);
  if (!(specular > 0)) return 0;
  if (!(Luminance(brdf.diffuse) > 0)) return 1;
  return std::clamp(specular / (specular + diffuse), 0.1f, 0.9f);
}

bool Above(const glm::vec3& wo, const glm::vec3& wi) { return wo.z > 0 && wi.z > 0; }

}  // namespace

glm::vec3 EvaluateCosine(const Brdf& brdf, const glm::vec3& wo, const glm::vec3& wi) {
  if (!Above(wo, wi)) return glm::vec3(0);
  const glm::vec3 h = glm::normalize(wo + wi);
  const float specular = SpecularCosine(brdf, wo, wi, h);
  const glm::vec3 diffuse = brdf.diffuse * (wi.z / kPi);
  if (brdf.model != BrdfModel::kGgx) return brdf.specular * specular + diffuse;
  const glm::vec3 fresnel =
      brdf.specular + (glm::vec3(1) - brdf.specular) * Fifth(std::max(0.0f, 1 - glm::dot(wo, h)));
  return fresnel * specular + (glm::vec3(1) - fresnel) * diffuse;
}

float PdfBrdf(const Brdf& brdf, const glm::vec3& wo, const glm::vec3& wi) {
  if (!Above(wo, wi)) return 0;
  const float p = SpecularProbability(brdf, wo);
  const float specular = p > 0 ? SpecularPdf(brdf, wo, wi, glm::normalize(wo + wi)) : 0;
  return p * specular + (1 - p) * wi.z / kPi;
}

BrdfSample SampleBrdf(const Brdf& brdf, const glm::vec3& wo, float u_lobe, float u, float v) {
  if (!(wo.z > 0)) return {};
  const bool specular = u_lobe < SpecularProbability(brdf, wo);
  const glm::vec3 wi = specular ? SampleSpecular(brdf, wo, u, v) : SampleCosine(u, v);
  const float pdf = PdfBrdf(brdf, wo, wi);
  if (!(pdf > 0) || !std::isfinite(pdf)) return {};
  return {wi, EvaluateCosine(brdf, wo, wi) / pdf, pdf};
}

}  // namespace glint
