#include "common/render/prefilter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "common/base/parallel.h"
#include "common/render/irradiance.h"
#include "common/render/sphere_grid.h"

namespace glint {
namespace {

/// Powers of two, so that the level is the exponent of kappa.
constexpr int kLowestExponent = -1, kHighestExponent = 15;
constexpr float kLowestKappa = 0.5f;
/// Octahedral cells per side for kappa = 1. Cells are 3.5 / side wide on average, 4.6 at most.
constexpr float kSidePerRootKappa = 16;
constexpr int kMinSide = 32, kMaxSide = 1024, kCosineSide = 128;
/// Convolution nodes stand this part of the lobe's standard deviation 1 / sqrt(kappa) apart.
constexpr double kNodeSpacing = 0.6;
constexpr int kMinGridHeight = 32;

int SideFor(double kappa) {
  const int side = static_cast<int>(std::ceil(kSidePerRootKappa * std::sqrt(kappa) / 8)) * 8;
  return std::clamp(side, kMinSide, kMaxSide);
}

/// Sharpest level: its variance is still above half a texel squared.
int HighestExponentFor(double spacing) {
  const int resolved = static_cast<int>(std::floor(std::log2(2 / (spacing * spacing))));
  return std::clamp(resolved, kLowestExponent, kHighestExponent);
}

/// Masses for a lobe, remade from `fine` when `current` does not fit: levels share a grid where they can.
void FitMasses(const SphereMasses& fine, double kappa, std::optional<SphereMasses>& current) {
  const double spacing = std::max(kNodeSpacing / std::sqrt(kappa), fine.spacing());
  int height = std::max(kMinGridHeight, static_cast<int>(std::ceil(std::numbers::pi / spacing - 1e-6)));
  height = std::min(height, fine.height());
  const int width = std::min(2 * height, fine.width() + fine.width() % 2);
  if (current && current->width() == width && current->height() == height) return;
  current = SphereMasses::Coarsened(fine, width, height);
}

/// Environment coordinates of a map's nodes, row by row.
std::vector<glm::vec2> NodeCoordinates(int side, int threads) {
  const OctahedralMap map(side);
  const size_t stride = static_cast<size_t>(side) + 1;
  std::vector<glm::vec2> result(stride * stride);
  ParallelFor(stride, threads, 4, [&](size_t y, int) {
    for (int x = 0; x <= side; ++x)
      result[y * stride + x] = Environment::Coordinates(map.NodeDirection(x, static_cast<int>(y)));
  });
  return result;
}

template <class ValueAt>
OctahedralMap Tabulate(int side, int threads, const ValueAt& value_at) {
  OctahedralMap map(side);
  ParallelFor(static_cast<size_t>(side) + 1, threads, 4, [&](size_t y, int) {
    for (int x = 0; x <= side; ++x) {
      map.at(x, static_cast<int>(y)) = glm::vec4(value_at(x, static_cast<int>(y)), 0);
    }
  });
  return map;
}

}  // namespace

PrefilteredEnvironment::PrefilteredEnvironment(const Environment& environment, int threads)
    : environment_(environment) {
  BuildLevels(threads);
  BuildCosine(threads);
}

void PrefilteredEnvironment::BuildLevels(int threads) {
  const SphereMasses fine = SphereMasses::FromEnvironment(environment_);
  mean_ = fine.Mean();
  const double texel = std::numbers::pi / environment_.height();
  texel_variance_ = static_cast<float>(texel * texel / 6);

  std::optional<SphereMasses> masses;
  std::vector<glm::vec2> coordinates;  // of the nodes: the sharp levels share one side, and arcs are dear
  const int highest = HighestExponentFor(fine.spacing());
  for (int exponent = kLowestExponent; exponent <= highest; ++exponent) {
    const double kappa = std::ldexp(1.0, exponent);
    FitMasses(fine, kappa, masses);
    const SphereConvolution convolution(*masses, kappa, threads);
    const int side = SideFor(kappa);
    const size_t stride = static_cast<size_t>(side) + 1;
    if (coordinates.size() != stride * stride) coordinates = NodeCoordinates(side, threads);
    levels_.push_back(Tabulate(side, threads, [&](int x, int y) {
      const glm::vec2& uv = coordinates[static_cast<size_t>(y) * stride + x];
      return convolution.At(uv.x, uv.y);
    }));
  }
  sharpest_kappa_ = std::ldexp(1.0f, highest);
}

void PrefilteredEnvironment::BuildCosine(int threads) {
  const IrradianceTree tree(environment_);
  const OctahedralMap map(kCosineSide);
  cosine_ =
      Tabulate(kCosineSide, threads, [&](int x, int y) { return tree.DimAverage(map.NodeDirection(x, y)); });
  bright_ = tree.bright();
}

glm::vec3 PrefilteredEnvironment::Filtered(const glm::vec3& mu, float kappa) const {
  const glm::vec2 p = OctahedralFromDirection(mu);
  // Towards kappa = 0 the lobe is (1 + kappa mu.s) / (4 pi) + O(kappa^2): linear in kappa.
  if (!(kappa > kLowestKappa)) {
    const float t = std::max(kappa, 0.0f) / kLowestKappa;
    return glm::mix(mean_, ToVec3(levels_[0].Interpolated(p)), t);
  }
  if (kappa >= sharpest_kappa_) return BeyondSharpest(mu, kappa);
  const uint32_t bits = std::bit_cast<uint32_t>(kappa);
  const int level = static_cast<int>(bits >> 23) - 127 - kLowestExponent;
  const float m = std::bit_cast<float>((bits & 0x7fffffu) | 0x3f800000u) - 1;
  // Peaks of small lights grow with kappa, edges and slopes with its logarithm: between the two. On a
  // captured sunset this halved the largest error of log2(1 + m) = m (1.35 - 0.35 m).
  const float t = m * (1.17f - 0.17f * m);
  const Float4 low = levels_[level].Interpolated(p), high = levels_[level + 1].Interpolated(p);
  return ToVec3(low + (high - low) * t);
}

/// Blends the sharpest level, of variance v1 = 1 / kappa1, and the plain map so that the peak of a single
/// bright texel, which goes with 1 / (v + v_texel), comes out right; smooth surroundings are the same in
/// both.
glm::vec3 PrefilteredEnvironment::BeyondSharpest(const glm::vec3& mu, float kappa) const {
  const glm::vec3 sharpest = ToVec3(levels_.back().Interpolated(OctahedralFromDirection(mu)));
  const float v = 1 / kappa, v1 = 1 / sharpest_kappa_;
  const float t = v / v1 * (v1 + texel_variance_) / (v + texel_variance_);
  return glm::mix(environment_.Radiance(mu), sharpest, std::min(t, 1.0f));
}

glm::vec3 PrefilteredEnvironment::CosineAverage(const glm::vec3& n) const {
  glm::vec3 sum = ToVec3(cosine_.Interpolated(OctahedralFromDirection(n)));
  for (const IrradianceMoment& block : bright_) sum += block.Average(n);
  return sum;
}

glm::vec3 PrefilteredEnvironment::Radiance(const glm::vec3& d) const { return environment_.Radiance(d); }

}  // namespace glint
