#pragma once

#include <array>
#include <cstdint>

namespace glint {

/// Philox4x32-10 (Salmon et al. 2011): four random words as a pure function of a 128-bit counter and a 64-bit
/// key, so that a sample depends on what it is for and never on who drew it or when.
inline std::array<uint32_t, 4> Philox4x32(std::array<uint32_t, 4> counter, std::array<uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const uint64_t p0 = uint64_t{0xD2511F53u} * counter[0];
    const uint64_t p1 = uint64_t{0xCD9E8D57u} * counter[2];
    counter = {static_cast<uint32_t>(p1 >> 32) ^ counter[1] ^ key[0], static_cast<uint32_t>(p1),
               static_cast<uint32_t>(p0 >> 32) ^ counter[3] ^ key[1], static_cast<uint32_t>(p0)};
    key[0] += 0x9E3779B9u;
    key[1] += 0xBB67AE85u;
  }
  return counter;
}

/// Uniform float in the open interval (0, 1): never 0 (a logarithm may follow) and never 1.
inline float OpenUniform(uint32_t bits) { return (static_cast<float>(bits >> 9) + 0.5f) * 0x1p-23f; }

/// A stream of numbers for one (seed, a, b, c), for instance (bake seed, vertex, direction, layer).
class CounterRng {
 public:
  CounterRng(uint64_t seed, uint32_t a, uint32_t b = 0, uint32_t c = 0)
      : key_{static_cast<uint32_t>(seed), static_cast<uint32_t>(seed >> 32)}, counter_{0, a, b, c} {}

  uint32_t Bits() {
    if (used_ == 4) {
      block_ = Philox4x32(counter_, key_);
      ++counter_[0];
      used_ = 0;
    }
    return block_[used_++];
  }
  float Uniform() { return OpenUniform(Bits()); }

 private:
  std::array<uint32_t, 2> key_;
  std::array<uint32_t, 4> counter_;
  std::array<uint32_t, 4> block_{};
  int used_ = 4;
};

}  // namespace glint
