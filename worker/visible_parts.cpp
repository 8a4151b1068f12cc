// A blocker's edge leaves a part of a lobe that no round lobe is like. It is taken for a mixture of a few, by
// expectation-maximisation: k-means alone gives them hard edges, and where little is blocked more is lost by
// these than won.
#include "worker/visible_parts.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "common/archive/entry_light.h"
#include "common/lobes/vmf.h"

namespace glint {
namespace {

constexpr int kRounds = 2;  ///< of expectation-maximisation; more are hardly better
/// Of the tolerance for indirect light, whose measure has other units. Squared, it is what a lobe has to take
/// out of the square of a relit slice's error, 1 being all that the surface reflects.
constexpr double kPartOfTolerance = 0.1;
constexpr float kSamplesPerLobe = 6;  ///< lobes of fewer are shaped by where samples happen to lie
constexpr float kLog2e = 1.44269504f;
constexpr float kBroadest = 1e-3f;  ///< kappa: broader lobes count as this broad

double Tolerance(const ReadOut& read_out) { return kPartOfTolerance * double{read_out.lobe_tolerance}; }

Vmf LobeOf(const LightGroup& group, const SliceLobe& lobe) {
  return LobeOf(group.moment, group.strength, lobe);
}

/// Concentration of two lobes of these, one blurred by the other.
float Blurred(float a, float b) { return a * b / (a + b); }

SharingLobe Share(const Vmf& lobe, float factor) {
  return {{lobe.mu.x, lobe.mu.y, lobe.mu.z, lobe.kappa * kLog2e}, factor};
}

/// Square of the groups' distance from the samples, both relit, less what no groups change; for small angles.
/// 1 is the norm of what the surface reflects.
/// @param part  of the unoccluded lobe's weight, for each unit of strength
double Misfit2(const GatherKernels& kernels, const LightList& list, const LightGroups& groups, double part,
               const SliceLobe& lobe) {
  Vmf relit[kMaxLightGroups];
  SharingLobe seen[kMaxLightGroups];
  double norm = 0;
  for (int i = 0; i < groups.size(); ++i) {
    const Vmf own = LobeOf(groups[i], lobe);
    relit[i] = {own.mu, Blurred(std::max(own.kappa, kBroadest), kJudgedLightKappa)};
    const float kappa = Blurred(relit[i].kappa, kJudgedLightKappa);
    seen[i] = Share({own.mu, kappa}, static_cast<float>(groups[i].strength) * kappa);
    for (int j = 0; j <= i; ++j) {
      const glm::vec3 chord = relit[i].mu - relit[j].mu;
      const float both = Blurred(relit[i].kappa, relit[j].kappa);
      norm += (i == j ? 1 : 2) * groups[i].strength * groups[j].strength *
              double{both * std::exp(-0.5f * both * glm::dot(chord, chord))};
    }
  }
  const double overlap = double{kernels.overlap(list, seen, groups.size())};
  const double whole = 0.5 * double{Blurred(std::max(lobe.resolved_kappa(), kBroadest), kJudgedLightKappa)};
  return part * part * (norm - 2 * overlap) / whole;
}

/// Rounds of expectation-maximisation from groups with edges to lobes that overlap.
LightGroups Soften(const GatherKernels& kernels, const LightList& list, const SliceLobe& lobe,
                   LightGroups groups) {
  for (int round = 0; round < kRounds; ++round) {
    SharingLobe sharing[kMaxLightGroups];
    for (int g = 0; g < groups.size(); ++g) {
      const Vmf vmf = LobeOf(groups[g], lobe);
      sharing[g] = Share(vmf, static_cast<float>(groups[g].strength) * VmfNormalization(vmf.kappa));
    }
    LightSums sums[kMaxLightGroups];
    kernels.share(list, sharing, groups.size(), sums);
    LightGroups next;
    for (int g = 0; g < groups.size(); ++g)
      if (sums[g].strength > 0)
        next.Add({sums[g].strength, {sums[g].moment[0], sums[g].moment[1], sums[g].moment[2]}, {}});
    groups = next;
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const LightGroup& a, const LightGroup& b) { return a.strength > b.strength; });
  return groups;
}

/// Samples of equal strength that would tell as much as the list's.
float EffectiveSamples(const LightList& list) {
  float sum = 0, squares = 0;
  for (int i = 0; i < list.count; ++i) {
    sum += list.channel[0][i];
    squares += list.channel[0][i] * list.channel[0][i];
  }
  return squares > 0 ? sum * sum / squares : 0;
}

}  // namespace

bool CanBeCutUp(const DirectMoments& moments, const ReadOut& read_out) {
  const double least = std::max(2 * Tolerance(read_out), double{read_out.drop});
  return read_out.slice_lobes > 1 && moments.visible > least && moments.visible < 1 - least;
}

LightGroups CutUp(const GatherKernels& kernels, const VisibleLight& light, double visible,
                  const SliceLobe& lobe, const ReadOut& read_out) {
  LightGroups one;
  if (!(light.total.strength > 0)) return one;
  one.Add(light.total);
  const int most =
      std::min(read_out.slice_lobes, static_cast<int>(EffectiveSamples(light.list) / kSamplesPerLobe));
  if (most < 2) return one;
  const double part = visible / light.total.strength;
  const double price = Tolerance(read_out) * Tolerance(read_out);
  const LightGroups hard = GroupLight(kernels, light.list, light.total, 0);
  LightGroups best = one;
  double least = Misfit2(kernels, light.list, one, part, lobe);
  const auto consider = [&](const LightGroups& groups) {
    const double cost = Misfit2(kernels, light.list, groups, part, lobe) + (groups.size() - 1) * price;
    if (cost < least) least = cost, best = groups;
  };
  for (int n = 2; n <= std::min(hard.size(), most); ++n) {
    LightGroups few = hard;
    JoinLikeGroups(n, 0, &few);
    consider(Soften(kernels, light.list, lobe, few));
  }
  return best;
}

}  // namespace glint
