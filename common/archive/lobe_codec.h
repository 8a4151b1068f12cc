#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <glm/vec3.hpp>
#include <vector>

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
/// These entries have 12 bytes.
void EncodeDirect(const DirectLobe& lobe, std::byte* out);
DirectLobe DecodeDirect(const std::byte* in);
void EncodeIndirect(const IndirectLobe& lobe, std::byte* out);
IndirectLobe DecodeIndirect(const std::byte* in);

/// Bytes of an entry in tables: the 12 that tasks write, or fewer bits of the same codes
/// (docs/archive-format.md has them and their bounds), ascending.
inline constexpr std::array<uint32_t, 3> kEntryBytes = {6, 8, 12};

/// Rounds an entry of 12 bytes to `bytes`, one of kEntryBytes.
void PackDirect(const std::byte* in, uint32_t bytes, std::byte* out);
void PackIndirect(const std::byte* in, uint32_t bytes, std::byte* out);
/// How a table's entries are written.
struct EntryPacking {
  bool direct;
  uint32_t bytes;  ///< one of kEntryBytes

  /// Appends an entry that a task wrote.
  void Append(const std::byte* entry, std::vector<std::byte>* out) const {
    out->resize(out->size() + bytes);
    std::byte* at = out->data() + out->size() - bytes;
    direct ? PackDirect(entry, bytes, at) : PackIndirect(entry, bytes, at);
  }
};

/// Decodes an entry of `bytes`, one of kEntryBytes.
DirectLobe DecodeDirect(const std::byte* in, uint32_t bytes);
IndirectLobe DecodeIndirect(const std::byte* in, uint32_t bytes);

/// Whether the bytes are what the encoder writes: reserved values of the codes are not used.
/// @param bytes  one of kEntryBytes
bool IsCanonicalDirect(const std::byte* in, uint32_t bytes = kDirectEntryBytes);
bool IsCanonicalIndirect(const std::byte* in, uint32_t bytes = kIndirectEntryBytes);

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

/// Widths of the fields of a packed entry, from the lowest bit on; shift and mu have several of the same.
struct DirectBits {
  int fraction, ratio, shift;
};
struct IndirectBits {
  int alpha, mu, kappa;  ///< alpha's three mantissas are followed by their exponent
};
inline constexpr int kExponentBits = 5, kExponentBias = 15;
inline constexpr DirectBits kDirect8{12, 13, 13}, kDirect6{9, 9, 10};
inline constexpr IndirectBits kIndirect8{9, 10, 12}, kIndirect6{6, 8, 9};
static_assert(kDirect8.fraction + kDirect8.ratio + 3 * kDirect8.shift == 64);
static_assert(kDirect6.fraction + kDirect6.ratio + 3 * kDirect6.shift == 48);
static_assert(3 * kIndirect8.alpha + kExponentBits + 2 * kIndirect8.mu + kIndirect8.kappa == 64);
static_assert(3 * kIndirect6.alpha + kExponentBits + 2 * kIndirect6.mu + kIndirect6.kappa == 48);

/// Takes fields out of a packed entry, the lowest first.
class BitReader {
 public:
  BitReader(const std::byte* in, uint32_t bytes) { std::memcpy(&bits_, in, bytes); }
  int Take(int width) {
    const auto value = static_cast<int>(bits_ & ((uint64_t{1} << width) - 1));
    bits_ >>= width;
    return value;
  }
  /// Two's complement.
  int TakeSigned(int width) {
    const int half = 1 << (width - 1);
    return (Take(width) ^ half) - half;
  }

 private:
  uint64_t bits_ = 0;
};

/// x * to / from for 0 <= x <= from, rounded: other codes for the same range.
constexpr int Rescale(int x, int from, int to) {
  return static_cast<int>((int64_t{x} * to + from / 2) / from);
}
constexpr int RescaleSigned(int x, int from, int to) {
  return x < 0 ? -Rescale(-x, from, to) : Rescale(x, from, to);
}
constexpr int LargestSigned(int width) { return (1 << (width - 1)) - 1; }

inline constexpr int kRatioOne = 32768;        ///< code of 1
inline constexpr int kKappaCodes = 65535 - 1;  ///< above code 1

inline DirectLobe UnpackDirect(BitReader bits, const DirectBits& width) {
  const int most = LargestSigned(width.ratio), largest = LargestSigned(width.shift);
  DirectLobe lobe;
  lobe.fraction =
      static_cast<float>(bits.Take(width.fraction)) / static_cast<float>((1 << width.fraction) - 1);
  const int ratio = std::max(bits.Take(width.ratio) - (most + 1), -most);
  const int code = kRatioOne + RescaleSigned(ratio, most, kRatioOne - 1);
  lobe.kappa_ratio = std::clamp(kRatioTable[static_cast<uint16_t>(code)], 1 / kMaxRatio, kMaxRatio);
  for (int i = 0; i < 3; ++i)
    lobe.shift[i] = 2.0f * static_cast<float>(std::max(bits.TakeSigned(width.shift), -largest)) /
                    static_cast<float>(largest);
  return lobe;
}

inline IndirectLobe UnpackIndirect(BitReader bits, const IndirectBits& width) {
  int mantissa[3];
  for (int& m : mantissa) m = bits.Take(width.alpha);
  const int exponent = bits.Take(kExponentBits) - kExponentBias - width.alpha;
  // 2^exponent, whose bits are those of a normal float for all codes.
  const float scale = std::bit_cast<float>(static_cast<uint32_t>(exponent + 127) << 23);
  IndirectLobe lobe;
  for (int i = 0; i < 3; ++i) lobe.alpha[i] = static_cast<float>(mantissa[i]) * scale;
  const int largest = LargestSigned(width.mu);
  const int u = std::max(bits.TakeSigned(width.mu), -largest),
            v = std::max(bits.TakeSigned(width.mu), -largest);
  const float step = 1.0f / static_cast<float>(largest);
  lobe.mu = OctahedralDirection(static_cast<float>(u) * step, static_cast<float>(v) * step);
  const int kappa = bits.Take(width.kappa);
  const int code = 1 + Rescale(kappa - 1, (1 << width.kappa) - 2, kKappaCodes);
  lobe.kappa = kappa == 0 ? 0.0f : std::min(kKappaTable[static_cast<uint16_t>(code)], kMaxKappa);
  return lobe;
}

}  // namespace lobe_codec_internal

inline DirectLobe DecodeDirect(const std::byte* in, uint32_t bytes) {
  using namespace lobe_codec_internal;
  if (bytes == 8) return UnpackDirect({in, 8}, kDirect8);
  return bytes == 6 ? UnpackDirect({in, 6}, kDirect6) : DecodeDirect(in);
}

inline IndirectLobe DecodeIndirect(const std::byte* in, uint32_t bytes) {
  using namespace lobe_codec_internal;
  if (bytes == 8) return UnpackIndirect({in, 8}, kIndirect8);
  return bytes == 6 ? UnpackIndirect({in, 6}, kIndirect6) : DecodeIndirect(in);
}

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
