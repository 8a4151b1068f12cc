#pragma once

#include <vector>

#include "common/lobes/brdf.h"

namespace glint {

/// Quadrature of one slice over the upper hemisphere, f cos with Fresnel factor one. The slice is symmetric
/// about the plane of incidence (wo = (sin, 0, cos)), so points lie on the side y > 0 and count for both.
/// Integrals are sums over points of weight * integrand; only x and z of the directions are kept, since lobes
/// lie in that plane.
struct SliceQuadrature {
  std::vector<double> x, z;         ///< direction wi
  std::vector<double> weight;       ///< solid angle that the point stands for, sr
  std::vector<double> root_weight;  ///< its square root
  std::vector<double> value;        ///< f cos, 1/sr
  std::vector<double> schlick;      ///< (1 - v.h)^5
  double albedo = 0;                ///< integral of value
  double norm2 = 0;                 ///< integral of value^2, 1/sr
};

/// Points on a `resolution` x `resolution` grid of a warp that follows the slice: visible normals for GGX,
/// cosine powers of half the exponent for the Phong models. Any sharpness is resolved by the same grid. cos_o
/// in (0, 1].
SliceQuadrature MakeSliceQuadrature(BrdfModel model, float shape, double cos_o, int resolution = 32);

}  // namespace glint
