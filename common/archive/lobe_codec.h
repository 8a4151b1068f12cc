#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <glm/vec3.hpp>

#include "common/base/half.h"
#include "common/base/status.h"
#include "common/lobes/vmf.h"

namespace glint {

/// Layer 0 entry: what blockers leave of one BRDF lobe, relative to the unoccluded lobe, so that neighbouring
/// slices, and free ones (fraction 1, no shift, ratio 1), interpolate without blurring sharp lobes.
struct DirectLobe {
  float fraction = 1;     ///< part of the lobe's weight that is unblocked, in [0, 1]
  glm::vec3 shift{0};     ///< mu - mu_unoccluded, world frame, components in [-2, 2]
  float kappa_ratio = 1;  ///< kappa / kappa_unoccluded, in [2^-20, 2^20]
};

/// Entry of the layers above: mean light that the lobe's directions bring from other surfaces, per unit of
/// the lobe's own weight (the BRDF's albedo is multiplied at look-up).
struct IndirectLobe {
  glm::vec3 alpha{0};  ///< linear RGB, in [0, 65504]
  glm::vec3 mu{0, 0, 1};
  float kappa = 0;  ///< in [0, kMaxKappa]
};

inline constexpr uint32_t kDirectEntryBytes = 12;  ///< 6 x 16 bit: fraction, kappa ratio, shift x, y, z, 0
inline constexpr uint32_t kIndirectEntryBytes =
    12;  ///< 6 x 16 bit: alpha r, g, b (half), octahedral mu x 2, kappa

/// Stated bounds (LobeCodecTest): fraction +-7.7e-6 (0 and 1 exact); shift +-3.06e-5 (0 exact);
/// kappa_ratio 2.2e-4 relative (1 exact); alpha 2^-11 relative above 6.2e-5, +-3e-8 below; mu within 4.4e-5
/// rad; kappa 1.6e-4 relative above 1e-3 (below it reads as 0). Values outside their ranges are clamped; what
/// is not a number becomes 0 (mu: +Z; ratio: 1). Encoding what was decoded gives the same bytes. Any bytes
/// decode to finite values within the ranges.
void EncodeDirect(const DirectLobe& lobe, std::byte* out);
DirectLobe DecodeDirect(const std::byte* in);
void EncodeIndirect(const IndirectLobe& lobe, std::byte* out);
IndirectLobe DecodeIndirect(const std::byte* in);

/// Whether the bytes are what the encoder writes: reserved values of the codes are not used.
bool IsCanonicalDirect(const std::byte* in);
bool IsCanonicalIndirect(const std::byte* in);

// Decoding is inline: the bake and the renderer do it dozens of times for each hit and pixel.

namespace lobe_codec_internal {

/// 2^(first + step * code) as the product of two table entries: 2 KiB in place of 256.
struct LogTable {
  float high[256], low[256];
  float operator[](uint16_t code) const { return high[code >> 8] * low[code & 255]; }
};
extern const LogTable kRatioTable;  ///< code 32768 is 1, 65535 is 2^20
extern const LogTable kKappaTable;  ///< code 1 is kMinStoredKappa, 65535 is kMaxKappa

inline constexpr float kMinStoredKappa = 1e-3f;
inline constexpr float kMaxRatio = 0x1p20f;
inline constexpr int kSnormMax = 32767;

inline float DecodeSnorm(uint16_t code) {
  return static_cast<float>(std::max<int>(static_cast<int16_t>(code), -kSnormMax)) * (1.0f / kSnormMax);
}

/// Unit vector of a point of the octahedral map (Meyer et al. 2010), co-ordinates in [-1, 1].
inline glm::vec3 OctahedralDirection(float u, float v) {
  const float z = 1 - std::abs(u) - std::abs(v), fold = std::max(-z, 0.0f);
  const float x = u - std::copysign(fold, u), y = v - std::copysign(fold, v);
  const float scale = 1 / std::sqrt(x * x + y * y + z * z);
  return {x * scale, y * scale, z * scale};
}

}  // namespace lobe_codec_internal

inline DirectLobe DecodeDirect(const std::byte* in) {
  using namespace lobe_codec_internal;
  uint16_t code[6];
  std::memcpy(code, in, sizeof code);
  DirectLobe lobe;
  lobe.fraction = static_cast<float>(code[0]) / 65535.0f;
  lobe.kappa_ratio = std::clamp(kRatioTable[code[1]], 1 / kMaxRatio, kMaxRatio);
  lobe.shift = {2 * DecodeSnorm(code[2]), 2 * DecodeSnorm(code[3]), 2 * DecodeSnorm(code[4])};
  return lobe;
}

inline IndirectLobe DecodeIndirect(const std::byte* in) {
  using namespace lobe_codec_internal;
  uint16_t code[6];
  std::memcpy(code, in, sizeof code);
  IndirectLobe lobe;
  lobe.alpha = {DecodeHalf(code[0]), DecodeHalf(code[1]), DecodeHalf(code[2])};
  lobe.mu = OctahedralDirection(DecodeSnorm(code[3]), DecodeSnorm(code[4]));
  lobe.kappa = code[5] == 0 ? 0.0f : std::min(kKappaTable[code[5]], kMaxKappa);
  return lobe;
}

}  // namespace glint
