#pragma once

#include <array>

#include "common/lobes/brdf_table.h"
#include "common/lobes/slice_quadrature.h"

namespace glint {

/// A vMF mixture in the plane of incidence, in the parameters that the fit moves.
struct SliceMixture {
  struct Lobe {
    double theta = 0;  ///< mu = (sin theta, 0, cos theta)
    double log_kappa = 0;
    double log_weight = 0;  ///< of the whole lobe, above and below the surface
  };
  int lobes = 0;
  std::array<Lobe, kMaxBrdfLobes> lobe{};
};

/// Part of a vMF with this theta and kappa that lies above the surface, in [0, 1]. Error <= 1e-3.
double PartAbove(double theta, double kappa);

/// A start without a neighbour: concentric lobes of falling sharpness about the mean direction, moved by
/// expectation-maximisation weighted with the slice.
SliceMixture StartMixture(const SliceQuadrature& slice, int lobes);

/// Least squares (Levenberg-Marquardt) on the mixture over the upper hemisphere, from `start`, under the
/// constraint that the parts above the surface sum to the slice's albedo (met exactly at the end). A weak
/// pull towards `start` decides where the slice itself does not.
SliceMixture FitMixture(const SliceQuadrature& slice, const SliceMixture& start, int iterations);

/// ||mixture - slice|| / ||slice|| over the upper hemisphere.
double RelativeL2(const SliceQuadrature& slice, const SliceMixture& mixture);

}  // namespace glint
