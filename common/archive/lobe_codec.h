#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "common/base/status.h"

namespace glint {

/// Layer 0 entry: what blockers leave of one BRDF lobe, relative to the unoccluded lobe, so that neighbouring slices,
/// and free ones (fraction 1, no shift, ratio 1), interpolate without blurring sharp lobes.
struct DirectLobe {
  float fraction = 1;      ///< part of the lobe's weight that is unblocked, in [0, 1]
  glm::vec3 shift{0};      ///< mu - mu_unoccluded, world frame, components in [-2, 2]
  float kappa_ratio = 1;   ///< kappa / kappa_unoccluded, in [2^-20, 2^20]
};

/// Entry of the layers above: mean light that the lobe's directions bring from other surfaces, per unit of the lobe's
/// own weight (the BRDF's albedo is multiplied at look-up).
struct IndirectLobe {
  glm::vec3 alpha{0};  ///< linear RGB, in [0, 65504]
  glm::vec3 mu{0, 0, 1};
  float kappa = 0;     ///< in [0, kMaxKappa]
};

inline constexpr uint32_t kDirectEntryBytes = 12;    ///< 6 x 16 bit: fraction, kappa ratio, shift x, y, z, 0
inline constexpr uint32_t kIndirectEntryBytes = 12;  ///< 6 x 16 bit: alpha r, g, b (half), octahedral mu x 2, kappa

/// Stated bounds (LobeCodecTest): fraction +-2^-17; shift +-2^-15; kappa_ratio 2.2e-4 relative; alpha 2^-11 relative
/// above 6e-5; mu within 4.4e-5 rad; kappa 2.5e-4 relative above 1e-3 (below it reads as 0).
void EncodeDirect(const DirectLobe& lobe, std::byte* out);
DirectLobe DecodeDirect(const std::byte* in);
void EncodeIndirect(const IndirectLobe& lobe, std::byte* out);
IndirectLobe DecodeIndirect(const std::byte* in);

}  // namespace glint
