#pragma once

#include "common/lobes/brdf_table.h"

namespace glint {

/// The vMF that stands for the part of a BRDF lobe above the surface (z > 0) where a whole lobe is read out:
/// its mean and width, from the moments of a normal distribution cut off at the horizon, which a lobe
/// resembles along the plane of incidence once kappa is more than a few. With a = the horizon's distance in
/// standard deviations below the mean and h = phi(a) / Phi(a): the mean rises by h, the variance along the
/// plane falls by the factor 1 - a h - h^2. Lobes that hardly reach the horizon (above > 0.995) come back as
/// they are. Weights are kept.
BrdfLobe AboveHorizon(const BrdfLobe& lobe);

}  // namespace glint
