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
std::vector<std::pair<int, int>> MortonCells(int side) {
  std::vector<std::pair<int, int>> cells;
  uint32_t covering = 4;
  while (covering < static_cast<uint32_t>(side)) covering *= 2;
  for (uint32_t code = 0; code < covering * covering; ++code) {
    const int x = static_cast<int>(CompactBits(code)), y = static_cast<int>(CompactBits(code >> 1));
    if (x < side && y < side) cells.emplace_back(x, y);
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

HemisphereLattice::HemisphereLattice(int side)
    : side_(side), solid_angle_(2 * kPi / static_cast<float>(side * side)) {
  const std::vector<std::pair<int, int>> order = MortonCells(side);
  std::vector<int> index(order.size());
  for (size_t i = 0; i < order.size(); ++i)
    index[order[i].second * side + order[i].first] = static_cast<int>(i);
  const float step = 1.0f / static_cast<float>(side);
  for (const auto& [x, y] : order) {
    directions_.push_back(SquareToHemisphere((x + 0.5f) * step, (y + 0.5f) * step));
    for (int q = 0; q < 4; ++q)
      quarters_.push_back(
          SquareToHemisphere((x + 0.25f + 0.5f * (q & 1)) * step, (y + 0.25f + 0.5f * (q >> 1)) * step));
    right_.push_back(x + 1 < side ? index[y * side + x + 1] : -1);
    below_.push_back(y + 1 < side ? index[(y + 1) * side + x] : -1);
  }
  for (int tile = 0; tile < tiles(); ++tile) {
    glm::vec3 sum(0);
    for (int i = 0; i < kTileCells; ++i) sum += directions_[tile * kTileCells + i];
    const glm::vec3 axis = glm::normalize(sum);
    float cosine = 1;
    for (int i = 0; i < kTileCells; ++i)
      for (int q = 0; q < 4; ++q)
        cosine = std::min(cosine, glm::dot(axis, quarter(tile * kTileCells + i, q)));
    cones_.push_back({axis, cosine, std::sqrt(std::max(0.0f, 1 - cosine * cosine))});
  }
}

}  // namespace glint
