#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <vector>

#include "common/base/rng.h"

namespace glint {

/// Well-distributed points in the unit square for the samples of one pixel: for each dimension pair the first
/// two Sobol dimensions, a (0,2)-sequence, in an order and with digits scrambled by hashing (the nested
/// scrambling of Owen 1995; by hashing as in Burley 2020, with a hash of our own). Everything is a function
/// of (seed, pixel, stream, pair, sample); different streams and pixels are independent, and each point alone
/// is uniform.
class PixelSamples {
 public:
  /// `pairs` dimension pairs, for sample numbers below `samples`.
  PixelSamples(int pairs, uint32_t samples) : scrambles_(static_cast<size_t>(pairs)) {
    while (index_mask_ + 1 < samples) index_mask_ = 2 * index_mask_ + 1;
  }

  /// Draws the scrambles of one pixel and stream. Any number of pixels may follow one another.
  void Start(uint64_t seed, uint32_t pixel, uint32_t stream) {
    CounterRng rng(seed, pixel, stream, kDomain);
    for (Scrambles& s : scrambles_) {
      for (Scramble* one : {&s.order, &s.x, &s.y})
        *one = {rng.Bits() | 1, rng.Bits(), rng.Bits() | 1, rng.Bits()};
    }
  }

  /// Point `sample` of dimension pair `pair`, both co-ordinates in (0, 1).
  glm::vec2 Point(int pair, uint32_t sample) const {
    const Scrambles& s = scrambles_[static_cast<size_t>(pair)];
    const uint32_t index = Reverse(Hash(Reverse(sample), s.order)) & index_mask_;
    return {OpenUniform(Reverse(Hash(index, s.x))), OpenUniform(Reverse(Hash(ReversedSobol1(index), s.y)))};
  }

 private:
  static constexpr uint32_t kDomain = 0x70786C73u;  ///< keeps these streams apart from all others of the seed

  struct Scramble {
    uint32_t scale0, shift0, scale1, shift1;  ///< scales are odd
  };
  struct Scrambles {
    Scramble order, x, y;
  };

  /// A random bijection in which each bit depends on itself and lower bits only: on bit-reversed fractions
  /// that is a nested scrambling, which keeps every elementary interval's count.
  static uint32_t Hash(uint32_t x, const Scramble& s) {
    x = x * s.scale0 + s.shift0;
    x ^= x * 0x9E3779B8u;
    x = x * s.scale1 + s.shift1;
    x ^= x * 0x85EBCA6Au;
    return x;
  }
  static uint32_t Reverse(uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = ((x >> 8) & 0x00FF00FFu) | ((x & 0x00FF00FFu) << 8);
    x = ((x >> 4) & 0x0F0F0F0Fu) | ((x & 0x0F0F0F0Fu) << 4);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    return ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  }
  /// The second Sobol dimension with its bits reversed. Its generator matrix is Pascal's triangle mod 2, and
  /// C(j, i) is odd just when i's bits are among j's, so the product is a sum over supersets of bit
  /// positions: five steps.
  static uint32_t ReversedSobol1(uint32_t x) {
    x ^= (x >> 1) & 0x55555555u;
    x ^= (x >> 2) & 0x33333333u;
    x ^= (x >> 4) & 0x0F0F0F0Fu;
    x ^= (x >> 8) & 0x00FF00FFu;
    x ^= (x >> 16) & 0x0000FFFFu;
    return x;
  }

  std::vector<Scrambles> scrambles_;
  uint32_t index_mask_ = 0;
};

}  // namespace glint
