// Which samples of a slice make one lobe together. A slice that sees different things, or one thing past an
// edge, has its light from directions that no single lobe covers without covering much else.
#include "worker/light_groups.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "common/base/frame.h"
#include "common/lobes/vmf.h"

namespace glint {
namespace {

constexpr double kNarrow = 1;        ///< spread of one point's light, times the unoccluded lobe's kappa
constexpr int kRounds = 2;           ///< of k-means; a third changes next to nothing
constexpr int kPowerIterations = 4;  ///< the axes only start it
constexpr float kLine = 0.5f;        ///< a spread whose second axis is shorter by this much is a line

/// Symmetric 3 x 3 matrix: xx, xy, xz, yy, yz, zz.
struct Spread {
  float c[6] = {};
  glm::vec3 operator*(const glm::vec3& v) const {
    return {c[0] * v.x + c[1] * v.y + c[2] * v.z, c[1] * v.x + c[3] * v.y + c[4] * v.z,
            c[2] * v.x + c[4] * v.y + c[5] * v.z};
  }
  /// Its longest column: no start of a power iteration is less likely to be across the first axis.
  glm::vec3 LongestColumn() const {
    const glm::vec3 columns[3] = {{c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}};
    return *std::max_element(columns, columns + 3, [](const glm::vec3& a, const glm::vec3& b) {
      return glm::dot(a, a) < glm::dot(b, b);
    });
  }
};

/// Unit vector along v, or 0.
glm::vec3 UnitOrZero(const glm::vec3& v) {
  const float length = glm::length(v);
  return length > 1e-30f ? v / length : glm::vec3(0);
}

/// The spread's first and second axes, each as long as its standard deviation.
std::array<glm::vec3, 2> PrincipalAxes(const Spread& spread, float strength) {
  glm::vec3 first = UnitOrZero(spread.LongestColumn());
  for (int i = 0; i < kPowerIterations; ++i) first = UnitOrZero(spread * first);
  const float variance = glm::dot(first, spread * first);
  Spread rest = spread;  // without the first axis
  const float removed[6] = {first.x * first.x, first.x * first.y, first.x * first.z,
                            first.y * first.y, first.y * first.z, first.z * first.z};
  for (int i = 0; i < 6; ++i) rest.c[i] -= variance * removed[i];
  glm::vec3 second = UnitOrZero(rest.LongestColumn());
  for (int i = 0; i < kPowerIterations; ++i) second = UnitOrZero(rest * second);
  const float rest_variance = std::max(0.0f, glm::dot(second, rest * second));
  return {first * std::sqrt(std::max(0.0f, variance) / strength),
          second * std::sqrt(rest_variance / strength)};
}

/// Four places in a row where the spread is a line, else in a square.
void PlaceCentres(const glm::vec3& mean, const std::array<glm::vec3, 2>& axes,
                  float centres[kMaxLightGroups][3]) {
  static_assert(kMaxLightGroups == 4);
  const auto& [a, b] = axes;
  const bool line = glm::length(b) < kLine * glm::length(a);
  const glm::vec3 offset[4] = {line ? -1.2f * a : -a - b, line ? -0.4f * a : -a + b, line ? 0.4f * a : a - b,
                               line ? 1.2f * a : a + b};
  for (int g = 0; g < kMaxLightGroups; ++g)
    for (int c = 0; c < 3; ++c) centres[g][c] = mean[c] + offset[g][c];
}

/// Part of two groups' common spread that lies between them, times the root of their strength. Spread is
/// strength minus length of the moment: it adds up but for what lies between.
double JoinLoss(const LightGroup& a, const LightGroup& b) {
  const double strength = a.strength + b.strength;
  const double joined = glm::length(a.moment + b.moment), spread = strength - joined;
  if (spread <= 0) return 0;
  const double between = glm::length(a.moment) + glm::length(b.moment) - joined;
  return std::sqrt(strength) * std::max(0.0, between) / spread;
}

}  // namespace

LightGroup& LightGroup::operator+=(const LightGroup& o) {
  strength += o.strength;
  moment += o.moment;
  colour += o.colour;
  return *this;
}

LightGroup& LightGroup::operator*=(double factor) {
  strength *= factor;
  moment *= factor;
  colour *= factor;
  return *this;
}

void LightGroups::Join(int i, int j) {
  group_[i] += group_[j];
  group_[j] = group_[--count_];
}

void LightSamples::Add(const glm::vec3& light, const glm::vec3& moment) {
  const float values[LightList::kChannels] = {Luminance(light), moment.x, moment.y, moment.z,
                                              light.x,          light.y,  light.z};
  for (int c = 0; c < LightList::kChannels; ++c) {
    channels_[c].resize(static_cast<size_t>(count_));
    channels_[c].push_back(values[c]);
  }
  ++count_;
  total_ += LightGroup{values[0], glm::dvec3(moment), glm::dvec3(light)};
}

LightList LightSamples::List() {
  LightList list{};
  const size_t padded = (static_cast<size_t>(count_) + kLanes - 1) / kLanes * kLanes;
  for (int c = 0; c < LightList::kChannels; ++c) {
    channels_[c].resize(padded, 0);
    list.channel[c] = channels_[c].data();
  }
  list.count = static_cast<int>(padded);
  return list;
}

bool CanBeSplit(const IndirectMoments& moments, const SliceLobe& lobe, double tolerance) {
  const double strength = Luminance(glm::vec3(moments.alpha));
  if (!(strength > 0)) return false;
  const double spread = (1 - glm::length(moments.moment) / strength) * lobe.resolved_kappa();
  return spread > kNarrow && std::sqrt(strength) * (1 - kNarrow / spread) > tolerance;
}

LightGroups GroupLight(const GatherKernels& kernels, const LightList& list, const LightGroup& total,
                       double least_between) {
  LightGroups groups;
  if (!(total.strength > 0)) return groups;
  const glm::vec3 mean(total.moment / total.strength);
  Spread spread;
  kernels.spread(list, &mean.x, spread.c);
  const auto axes = PrincipalAxes(spread, static_cast<float>(total.strength));
  // Two halves lie at most the longest axis apart on either side, and 1 - cos is half the angle squared.
  if (0.5 * glm::dot(axes[0], axes[0]) < least_between * (1 - double{glm::length(mean)})) {
    groups.Add(total);
    return groups;
  }
  float centres[kMaxLightGroups][3];
  PlaceCentres(mean, axes, centres);
  LightSums sums[kMaxLightGroups];
  for (int round = 0; round < kRounds; ++round) {
    const bool last = round == kRounds - 1;
    kernels.group(list, centres, last, sums);
    for (int g = 0; g < kMaxLightGroups; ++g)
      for (int c = 0; c < 3; ++c)
        if (sums[g].strength > 0) centres[g][c] = sums[g].moment[c] / sums[g].strength;
  }
  for (const LightSums& s : sums)
    if (s.strength > 0)
      groups.Add(
          {s.strength, {s.moment[0], s.moment[1], s.moment[2]}, {s.colour[0], s.colour[1], s.colour[2]}});
  return groups;
}

void JoinLikeGroups(int most, double tolerance, LightGroups* groups) {
  while (groups->size() > 1) {
    double least = 0;
    std::pair<int, int> pair{-1, -1};
    for (int i = 0; i < groups->size(); ++i)
      for (int j = i + 1; j < groups->size(); ++j) {
        const double loss = JoinLoss((*groups)[i], (*groups)[j]);
        if (pair.first < 0 || loss < least) least = loss, pair = {i, j};
      }
    if (groups->size() <= most && least > tolerance) break;
    groups->Join(pair.first, pair.second);
  }
  std::stable_sort(groups->begin(), groups->end(),
                   [](const LightGroup& a, const LightGroup& b) { return a.strength > b.strength; });
}

}  // namespace glint
