#include "worker/lattice.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"

namespace glint {
namespace {

uint32_t CompactBits(uint32_t x) {
  x &= 0x55555555u;
  x = (x | (x >> 1)) & 0x33333333u;
  x = (x | (x >> 2)) & 0x0F0F0F0Fu;
  x = (x | (x >> 4)) & 0x00FF00FFu;
  return (x | (x >> 8)) & 0x0000FFFFu;
}

/// (x, y) of every cell in Morton order; sides that are no power of two leave out what falls outside.
std::vector<std::array<uint16_t, 2>> MortonCells(int side) {
  std::vector<std::array<uint16_t, 2>> cells;
  uint32_t covering = 4;
  while (covering < static_cast<uint32_t>(side)) covering *= 2;
  for (uint32_t code = 0; code < covering * covering; ++code) {
    const int x = static_cast<int>(CompactBits(code)), y = static_cast<int>(CompactBits(code >> 1));
    if (x < side && y < side) cells.push_back({static_cast<uint16_t>(x), static_cast<uint16_t>(y)});
  }
  return cells;
}

}  // namespace

glm::vec3 SquareToHemisphere(float u, float v) {
  // Concentric map: squares around the centre become circles (Shirley and Chiu 1997).
  const float a = 2 * u - 1, b = 2 * v - 1;
  float r = 0, phi = 0;
  if (std::abs(a) > std::abs(b)) {
    r = a;
    phi = (kPi / 4) * (b / a);
  } else if (b != 0) {
    r = b;
    phi = kPi / 2 - (kPi / 4) * (a / b);
  }
  // Lambert: z = 1 - r^2 gives equal areas on the hemisphere.
  const float sine = r * std::sqrt(std::max(0.0f, 2 - r * r));
  return {sine * std::cos(phi), sine * std::sin(phi), 1 - r * r};
}

HemisphereLattice::HemisphereLattice(int side) : side_(side) {
  places_[0] = MortonCells(side);
  for (int level = 1; level < kLevels; ++level)
    for (const auto& [x, y] : places_[level - 1])
      for (int q = 0; q < 4; ++q)
        places_[level].push_back(
            {static_cast<uint16_t>(2 * x + (q & 1)), static_cast<uint16_t>(2 * y + (q >> 1))});
  for (int level = 0; level < kLevels; ++level) {
    const int fine = side << level;
    const float step = 1.0f / static_cast<float>(fine);
    solid_angle_[level] = 2 * kPi / static_cast<float>(fine) / static_cast<float>(fine);
    for (int i = 0; i < fine * fine; ++i) {
      const auto [x, y] = place(level, i);
      float u = (static_cast<float>(x) + 0.5f) * step, v = (static_cast<float>(y) + 0.5f) * step;
      const bool border = x == 0 || y == 0 || x == side - 1 || y == side - 1;
      if (level == 0 && border) {
        // A step along the radius of the disk scales the square about its middle.
        const float radius = 1 - step, shift = (x + y) % 2 == 0 ? 0.5f : -0.5f;
        const float scale = (radius + shift * step) / radius;
        u = 0.5f + (u - 0.5f) * scale;
        v = 0.5f + (v - 0.5f) * scale;
      }
      directions_[level].push_back(SquareToHemisphere(u, v));
    }
  }
  const int finest = 1 << (2 * (kLevels - 1));
  for (int tile = 0; tile < tiles(); ++tile) {
    glm::vec3 sum(0);
    for (int i = 0; i < kTileCells; ++i) sum += directions_[0][tile * kTileCells + i];
    const glm::vec3 axis = glm::normalize(sum);
    float cosine = 1;
    for (int i = 0; i < kTileCells * finest; ++i)
      cosine = std::min(cosine, glm::dot(axis, directions_[kLevels - 1][tile * kTileCells * finest + i]));
    cones_.push_back({axis, cosine, std::sqrt(std::max(0.0f, 1 - cosine * cosine))});
    all_cones_.Add(cones_.back());
    all_tiles_.push_back(static_cast<uint16_t>(tile));
  }
  all_cones_.Finish();
}

}  // namespace glint
