// Lobes in six 16-bit codes. Concentrations are coded by their logarithm, because half floats of kappa or of
// the mean cosine lose sharp lobes. Bytes: docs/archive-format.md.
#include "common/archive/lobe_codec.h"

namespace glint {
namespace lobe_codec_internal {
namespace {

/// 2^x by a Taylor series, evaluated by the compiler: the tables are the same whatever mathematics library is
/// linked.
constexpr double Exp2(double x) {
  int whole = static_cast<int>(x);
  const double y = (x - whole) * 0.693147180559945309417;
  double sum = 1;
  for (int n = 24; n > 0; --n) sum = 1 + sum * y / n;
  for (; whole > 0; --whole) sum *= 2;
  for (; whole < 0; ++whole) sum /= 2;
  return sum;
}

constexpr LogTable MakeLogTable(double first, double step) {
  LogTable table{};
  for (int i = 0; i < 256; ++i) {
    table.high[i] = static_cast<float>(Exp2(first + 256 * i * step));
    table.low[i] = static_cast<float>(Exp2(i * step));
  }
  return table;
}

constexpr uint16_t kReservedSnorm = 0x8000;

constexpr double kRatioStep = 20.0 / 32767;
constexpr double kRatioFirst = -32768 * kRatioStep;
constexpr double kLog2MinKappa = -9.96578428466208704577;  // log2(1e-3)
constexpr double kLog2MaxKappa = 19.9315685693241740915;   // log2(1e6)
constexpr double kKappaStep = (kLog2MaxKappa - kLog2MinKappa) / 65534;
constexpr double kKappaFirst = kLog2MinKappa - kKappaStep;
static_assert(kMaxKappa == 1e6f && kMinStoredKappa == 1e-3f);

}  // namespace

constinit const LogTable kRatioTable = MakeLogTable(kRatioFirst, kRatioStep);
constinit const LogTable kKappaTable = MakeLogTable(kKappaFirst, kKappaStep);

namespace {

/// x within [low, high]; `otherwise` for what is not a number.
float ClampFinite(float x, float low, float high, float otherwise) {
  return std::isnan(x) ? otherwise : std::clamp(x, low, high);
}

/// To the nearest, halves away from zero; unlike std::lround no call, and a bake encodes tens of millions.
int Round(double x) { return static_cast<int>(x + std::copysign(0.5, x)); }

uint16_t EncodeUnorm(float x) {
  return static_cast<uint16_t>(Round(double{ClampFinite(x, 0, 1, 0)} * 65535));
}

/// x in [-1, 1].
uint16_t EncodeSnorm(float x) {
  return static_cast<uint16_t>(static_cast<int16_t>(Round(double{ClampFinite(x, -1, 1, 0)} * kSnormMax)));
}

uint16_t EncodeRatio(float ratio) {
  const double x = ClampFinite(ratio, 1 / kMaxRatio, kMaxRatio, 1);
  return static_cast<uint16_t>(Round((std::log2(x) - kRatioFirst) / kRatioStep));
}

uint16_t EncodeKappa(float kappa) {
  const double x = ClampFinite(kappa, 0, kMaxKappa, 0);
  if (x < kMinStoredKappa) return 0;
  return static_cast<uint16_t>(std::clamp(Round((std::log2(x) - kKappaFirst) / kKappaStep), 1, 65535));
}

struct Octahedral {
  int u = 0, v = 0;  ///< in [-kSnormMax, kSnormMax]
};

/// The border of the map is folded onto itself; of codes for one direction this picks one.
/// @param border  largest code
Octahedral Canonical(Octahedral code, int border = kSnormMax) {
  if (std::abs(code.u) == border) code.v = std::abs(code.v);
  if (std::abs(code.v) == border) code.u = std::abs(code.u);
  if (std::abs(code.u) == border) code.v = std::abs(code.v);
  return code;
}

/// The best of the four codes around the direction's place in the map (Cigolle et al. 2014): plain rounding
/// would be off by up to 6.5e-5 rad.
Octahedral EncodeOctahedral(const glm::vec3& direction) {
  const double norm =
      std::abs(double{direction.x}) + std::abs(double{direction.y}) + std::abs(double{direction.z});
  if (!(norm > 0) || !std::isfinite(norm)) return {};
  double u = direction.x / norm, v = direction.y / norm;
  if (direction.z < 0) {
    const double folded_u = std::copysign(1 - std::abs(v), u);
    v = std::copysign(1 - std::abs(u), v);
    u = folded_u;
  }
  const auto floor_code = [](double x) {
    const int towards_zero = static_cast<int>(x * kSnormMax);
    return std::clamp(towards_zero - (x < 0), -kSnormMax, kSnormMax - 1);
  };
  const Octahedral corner{floor_code(u), floor_code(v)};
  // Whose squared cosine with the direction, dot^2 / length^2, is largest, compared without a division.
  Octahedral best;
  double best_dot2 = -1, best_length2 = 1;
  for (int i = 0; i < 4; ++i) {
    const Octahedral code{corner.u + (i & 1), corner.v + (i >> 1)};
    const double cu = code.u, cv = code.v;
    const double z = kSnormMax - std::abs(cu) - std::abs(cv), fold = std::max(-z, 0.0);
    const double x = cu - std::copysign(fold, cu), y = cv - std::copysign(fold, cv);
    const double dot = x * direction.x + y * direction.y + z * direction.z;
    const double dot2 = dot * dot, length2 = x * x + y * y + z * z;
    if (dot2 * best_length2 > best_dot2 * length2) {
      best_dot2 = dot2;
      best_length2 = length2;
      best = code;
    }
  }
  return Canonical(best);
}

}  // namespace
}  // namespace lobe_codec_internal

using namespace lobe_codec_internal;

void EncodeDirect(const DirectLobe& lobe, std::byte* out) {
  const uint16_t code[6] = {EncodeUnorm(lobe.fraction),    EncodeRatio(lobe.kappa_ratio),
                            EncodeSnorm(lobe.shift.x / 2), EncodeSnorm(lobe.shift.y / 2),
                            EncodeSnorm(lobe.shift.z / 2), 0};
  std::memcpy(out, code, sizeof code);
}

void EncodeIndirect(const IndirectLobe& lobe, std::byte* out) {
  const Octahedral mu = EncodeOctahedral(lobe.mu);
  const uint16_t code[6] = {EncodeHalf(lobe.alpha.x),
                            EncodeHalf(lobe.alpha.y),
                            EncodeHalf(lobe.alpha.z),
                            static_cast<uint16_t>(static_cast<int16_t>(mu.u)),
                            static_cast<uint16_t>(static_cast<int16_t>(mu.v)),
                            EncodeKappa(lobe.kappa)};
  std::memcpy(out, code, sizeof code);
}

namespace {

/// Puts fields into a packed entry, the lowest first.
class BitWriter {
 public:
  void Put(int value, int width) {
    bits_ |= (static_cast<uint64_t>(value) & ((uint64_t{1} << width) - 1)) << at_;
    at_ += width;
  }
  void Write(std::byte* out) const { std::memcpy(out, &bits_, static_cast<size_t>(at_ / 8)); }

 private:
  uint64_t bits_ = 0;
  int at_ = 0;
};

void PackDirect(const std::byte* in, const DirectBits& width, std::byte* out) {
  uint16_t code[6];
  std::memcpy(code, in, sizeof code);
  BitWriter bits;
  bits.Put(Rescale(code[0], 65535, (1 << width.fraction) - 1), width.fraction);
  const int most = LargestSigned(width.ratio);
  bits.Put(most + 1 + RescaleSigned(std::max<int>(code[1], 1) - kRatioOne, kRatioOne - 1, most), width.ratio);
  for (int i = 2; i < 5; ++i)
    bits.Put(RescaleSigned(std::max<int>(static_cast<int16_t>(code[i]), -kSnormMax), kSnormMax,
                           LargestSigned(width.shift)),
             width.shift);
  bits.Write(out);
}

/// Mantissas of one exponent, such that the largest uses all its bits.
void PutAlpha(const glm::vec3& alpha, int width, BitWriter* bits) {
  const float largest = std::max({alpha.x, alpha.y, alpha.z});
  const int most = (1 << width) - 1, highest = (1 << kExponentBits) - 1 - kExponentBias;
  int exponent = largest > 0 ? std::max(std::ilogb(largest) + 1, -kExponentBias) : -kExponentBias;
  float scale = std::ldexp(1.0f, width - exponent);
  const auto mantissa = [&](float x) { return Round(x * scale); };
  if (mantissa(largest) > most && exponent < highest) {
    ++exponent;
    scale /= 2;
  }
  for (int i = 0; i < 3; ++i) bits->Put(std::min(mantissa(alpha[i]), most), width);
  bits->Put(exponent + kExponentBias, kExponentBits);
}

void PackIndirect(const std::byte* in, const IndirectBits& width, std::byte* out) {
  uint16_t code[6];
  std::memcpy(code, in, sizeof code);
  BitWriter bits;
  PutAlpha({DecodeHalf(code[0]), DecodeHalf(code[1]), DecodeHalf(code[2])}, width.alpha, &bits);
  const int border = LargestSigned(width.mu);
  const auto narrow = [&](uint16_t c) {
    return RescaleSigned(std::max<int>(static_cast<int16_t>(c), -kSnormMax), kSnormMax, border);
  };
  const Octahedral mu = Canonical({narrow(code[3]), narrow(code[4])}, border);
  bits.Put(mu.u, width.mu);
  bits.Put(mu.v, width.mu);
  bits.Put(code[5] == 0 ? 0 : 1 + Rescale(code[5] - 1, kKappaCodes, (1 << width.kappa) - 2), width.kappa);
  bits.Write(out);
}

}  // namespace

void PackDirect(const std::byte* in, uint32_t bytes, std::byte* out) {
  if (bytes == kDirectEntryBytes) {
    std::memcpy(out, in, bytes);
  } else {
    PackDirect(in, bytes == 8 ? kDirect8 : kDirect6, out);
  }
}

void PackIndirect(const std::byte* in, uint32_t bytes, std::byte* out) {
  if (bytes == kIndirectEntryBytes) {
    std::memcpy(out, in, bytes);
  } else {
    PackIndirect(in, bytes == 8 ? kIndirect8 : kIndirect6, out);
  }
}

bool IsCanonicalDirect(const std::byte* in, uint32_t bytes) {
  if (bytes != kDirectEntryBytes) {
    std::byte whole[kDirectEntryBytes], again[kDirectEntryBytes];
    EncodeDirect(DecodeDirect(in, bytes), whole);
    PackDirect(whole, bytes, again);
    return std::memcmp(in, again, bytes) == 0;
  }
  uint16_t code[6];
  std::memcpy(code, in, sizeof code);
  return code[1] != 0 && code[2] != kReservedSnorm && code[3] != kReservedSnorm &&
         code[4] != kReservedSnorm && code[5] == 0;
}

bool IsCanonicalIndirect(const std::byte* in, uint32_t bytes) {
  if (bytes != kIndirectEntryBytes) {
    std::byte whole[kIndirectEntryBytes], again[kIndirectEntryBytes];
    EncodeIndirect(DecodeIndirect(in, bytes), whole);
    PackIndirect(whole, bytes, again);
    return std::memcmp(in, again, bytes) == 0;
  }
  uint16_t code[6];
  std::memcpy(code, in, sizeof code);
  if (code[0] > kMaxHalf || code[1] > kMaxHalf || code[2] > kMaxHalf) return false;
  if (code[3] == kReservedSnorm || code[4] == kReservedSnorm) return false;
  const Octahedral mu{static_cast<int16_t>(code[3]), static_cast<int16_t>(code[4])};
  const Octahedral canonical = Canonical(mu);
  return mu.u == canonical.u && mu.v == canonical.v;
}

}  // namespace glint
