#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/lobes/brdf.h"

namespace glint {

inline constexpr int kMaxBrdfLobes = 4;           ///< specular lobes per slice
inline constexpr int kElevationNodes = 64;        ///< slices are fitted at cos_o = ElevationNode(i)
inline constexpr float kMinCosine = 1.0f / 4096;  ///< views closer to the horizon use this one's slice

/// cos_o of node i, max(kMinCosine, (i / (kElevationNodes - 1))^2): finer towards the horizon, where slices
/// change fastest and lose half of themselves under the surface. Its inverse is a square root.
constexpr float ElevationNode(int i) {
  const float t = static_cast<float>(i) / (kElevationNodes - 1);
  return t * t > kMinCosine ? t * t : kMinCosine;
}

/// One lobe of a BRDF slice in the plane of incidence: local frame with wo = (sin, 0, cos), so the mirror
/// direction has negative x.
struct BrdfLobe {
  float mu_x = 0, mu_z = 1;  ///< unit in the xz plane; mu_z may be slightly negative at grazing views
  float kappa = 0;
  float scale = 0, bias = 0;  ///< weight (albedo of this lobe) = specular * scale + bias, per channel
  float above = 1;            ///< part of the vMF above the surface, where the lobe is Weight() * vMF / above

  glm::vec3 Weight(const glm::vec3& specular) const { return specular * scale + glm::vec3(bias); }
};

/// Up to kMaxBrdfLobes lobes; lobe k of neighbouring slices correspond, so that they can be interpolated
/// (sorted by kappa at normal incidence, sharpest first).
struct BrdfSlice {
  int lobes = 0;
  std::array<BrdfLobe, kMaxBrdfLobes> lobe{};
};

/// How well the lobes of one shape reproduce its slices, over all elevation nodes.
struct BrdfFitError {
  float mean_l2 = 0;  ///< ||fit - slice|| / ||slice|| (F = 1), mean over view directions (uniform in cos_o)
  float max_l2 = 0;
  float max_albedo = 0;         ///< largest relative error of the slice's integral
  float max_below_horizon = 0;  ///< largest part of a slice's lobes under the surface, before `above`
};

/// Specular slices of one (model, shape), fitted by vMF mixtures over elevation; scale and bias carry the
/// Fresnel term (for Phong models scale is the albedo and bias 0). Interpolates linearly between elevation
/// nodes.
struct BrdfShape {
  BrdfModel model = BrdfModel::kGgx;
  float shape = 1;
  int lobes = 1;
  std::vector<BrdfSlice> slices;  ///< kElevationNodes
  BrdfFitError error;
};

struct BrdfFitOptions {
  int max_lobes = 3;        ///< 1 .. kMaxBrdfLobes
  float tolerance = 0.05f;  ///< mean relative L2 at which no further lobe is added
};

/// Fits one shape: least squares on a quadrature of f cos over the hemisphere with F = 1, started at normal
/// incidence from expectation-maximisation and then from the neighbouring elevation, so lobes stay matched;
/// the number of lobes is the least that meets the tolerance. Only what lobes do above the surface counts.
/// Albedo is kept exactly (up to quadrature). Deterministic.
BrdfShape FitBrdfShape(BrdfModel model, float shape, const BrdfFitOptions& options = {});

/// Interpolated slice at cos_o in [0, 1].
BrdfSlice LookupSlice(const BrdfShape& shape, float cos_o);

/// Diffuse: the slice is albedo times the cosine lobe. For GGX the Fresnel factor (1 - F) is averaged over
/// wi: albedo = diffuse (1 - F0) t(cos_o); t(cos_o) = integral (1 - (1 - v.h)^5) cos_i / pi dwi. For Phong:
/// diffuse.
glm::vec3 DiffuseAlbedo(const Brdf& brdf, float cos_o);

/// A BRDF as the bake models it, for `--brdf lobes`: f cos_i as the mixture of the slice's lobes and the
/// cosine lobe, 1/sr, directions in the local frame (any azimuth). A lobe ends at the surface; its part above
/// carries its whole weight.
glm::vec3 EvaluateLobes(const Brdf& brdf, const BrdfShape& shape, const glm::vec3& wo, const glm::vec3& wi);
BrdfSample SampleLobes(const Brdf& brdf, const BrdfShape& shape, const glm::vec3& wo, float u_lobe, float u,
                       float v);
float PdfLobes(const Brdf& brdf, const BrdfShape& shape, const glm::vec3& wo, const glm::vec3& wi);

}  // namespace glint
