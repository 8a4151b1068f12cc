#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace glint {

inline constexpr uint16_t kMaxHalf = 0x7BFF;  ///< 65504

/// Nearest half, ties to even, of a value clamped to [0, 65504]; what is not a number gives 0.
inline uint16_t EncodeHalf(float value) {
  const float x = value > 0 ? std::min(value, 65504.0f) : 0.0f;
  // Below the normal range halves are multiples of 2^-24. Scaling is exact, and so is the rounding of lrint.
  if (x < 0x1p-14f) return static_cast<uint16_t>(std::lrint(x * 0x1p24f));
  const uint32_t bits = std::bit_cast<uint32_t>(x) - (112u << 23);
  return static_cast<uint16_t>((bits + 0x0FFFu + ((bits >> 13) & 1)) >> 13);
}

/// Half to float for what is not negative; arithmetic that needs neither F16C nor denormal floats.
inline float DecodeHalf(uint16_t half) {
  const uint32_t bits = std::min<uint32_t>(half & 0x7FFFu, kMaxHalf) << 13;
  const float normal = std::bit_cast<float>(bits + (112u << 23));
  const float subnormal = std::bit_cast<float>(bits + (113u << 23)) - 0x1p-14f;
  return bits < (1u << 23) ? subnormal : normal;
}

}  // namespace glint
