#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

namespace glint {

enum class BrdfModel : uint8_t { kGgx = 0, kPhong = 1, kBlinnPhong = 2 };

/// The reflectance at one surface point: what glTF 2.0 Appendix B, Phong or Blinn-Phong need, in linear RGB.
///   GGX: specular = F0, diffuse = base (1 - metallic), shape = perceptual roughness, alpha = max(roughness,
///   kMinRoughness)^2;
///        f = D G F / (4 cos_i cos_o) + (1 - F) diffuse / pi, F = F0 + (1 - F0)(1 - v.h)^5, separable Smith
///        G.
///   Phong: f = specular (n+2)/(2 pi) max(0, mirror.wi)^n + diffuse / pi, shape = n.
///   Blinn-Phong: f = specular (n+2)(n+4) / (8 pi (2^(-n/2) + n)) max(0, n.h)^n + diffuse / pi.
struct Brdf {
  BrdfModel model = BrdfModel::kGgx;
  float shape = 1;
  glm::vec3 specular{0.04f};
  glm::vec3 diffuse{0};
};

inline constexpr float kMinRoughness = 0.01f;

/// f(wo, wi) cos_i, directions in the local frame (z is the normal). 0 where either is below the surface.
/// 1/sr.
glm::vec3 EvaluateCosine(const Brdf& brdf, const glm::vec3& wo, const glm::vec3& wi);

/// A direction drawn (nearly) proportionally to f cos, for the reference tracer.
struct BrdfSample {
  glm::vec3 wi{0};      ///< local frame
  glm::vec3 weight{0};  ///< f cos / pdf; zero: no sample
  float pdf = 0;        ///< 1/sr
};
BrdfSample SampleBrdf(const Brdf& brdf, const glm::vec3& wo, float u_lobe, float u, float v);
float PdfBrdf(const Brdf& brdf, const glm::vec3& wo, const glm::vec3& wi);

}  // namespace glint
