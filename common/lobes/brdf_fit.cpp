// Fits the specular slices of one shape over all elevations (docs/mathematics.md, "BRDF slices as lobes").

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/lobes/brdf_table.h"
#include "common/lobes/slice_fit.h"
#include "common/lobes/slice_quadrature.h"

namespace glint {
namespace {

constexpr int kStartIterations = 60;
constexpr int kNeighbourIterations = 8;

double NodeCosine(int i) { return ElevationNode(i); }

// The neighbour's lobes, turned with the mirror direction from its elevation to this one.
SliceMixture Turned(const SliceMixture& m, double from_cos, double to_cos) {
  const double turn = std::acos(from_cos) - std::acos(to_cos);
  SliceMixture out = m;
  for (int k = 0; k < m.lobes; ++k) out.lobe[k].theta += turn;
  return out;
}

void SortBySharpness(SliceMixture& m) {
  std::sort(m.lobe.begin(), m.lobe.begin() + m.lobes,
            [](const auto& a, const auto& b) { return a.log_kappa > b.log_kappa; });
}

// Part of the view directions of a hemisphere, equal in cos_o, that node i stands for among every stride-th
// node.
double NodeShare(int i, int stride = 1) {
  const int below = std::max(i - stride, 0), over = std::min(i + stride, kElevationNodes - 1);
  return (NodeCosine(over) - NodeCosine(below)) / 2;
}

// Every stride-th slice from normal incidence down to the horizon, each started from the one before.
std::vector<SliceMixture> FitElevations(const std::vector<SliceQuadrature>& slices, int lobes, int stride) {
  std::vector<SliceMixture> fits(slices.size());
  const int top = static_cast<int>(slices.size()) - 1;
  fits[top] = FitMixture(slices[top], StartMixture(slices[top], lobes), kStartIterations);
  SortBySharpness(fits[top]);
  for (int i = top - stride; i >= 0; i -= stride) {
    const int last = i + stride;
    fits[i] =
        FitMixture(slices[i], Turned(fits[last], NodeCosine(last), NodeCosine(i)), kNeighbourIterations);
  }
  return fits;
}

// Least number of lobes within the tolerance, judged on every third elevation; where more lobes do not help
// by a hundredth, the fewer.
int ChooseLobes(const std::vector<SliceQuadrature>& slices, const BrdfFitOptions& options) {
  constexpr int kStride = 3;  // divides kElevationNodes - 1
  const int max_lobes = std::clamp(options.max_lobes, 1, kMaxBrdfLobes);
  int best = 1;
  double best_l2 = 0;
  for (int lobes = 1; lobes <= max_lobes; ++lobes) {
    const std::vector<SliceMixture> fits = FitElevations(slices, lobes, kStride);
    double l2 = 0;
    for (int i = 0; i < kElevationNodes; i += kStride)
      l2 += NodeShare(i, kStride) * RelativeL2(slices[i], fits[i]);
    if (lobes == 1 || l2 < 0.99 * best_l2) {
      best = lobes;
      best_l2 = l2;
    }
    if (l2 <= options.tolerance) break;
  }
  return best;
}

// Share of each lobe's reflectance that comes with Schlick's term, by how much of each point the lobe
// explains.
std::array<double, kMaxBrdfLobes> SchlickShares(const SliceQuadrature& slice, const SliceMixture& m,
                                                double& schlick_albedo) {
  std::array<double, kMaxBrdfLobes> mass{}, schlick{};
  schlick_albedo = 0;
  for (size_t p = 0; p < slice.value.size(); ++p) {
    std::array<double, kMaxBrdfLobes> part{};
    double sum = 1e-300;
    for (int k = 0; k < m.lobes; ++k) {
      const auto& l = m.lobe[k];
      const double kappa = std::exp(l.log_kappa);
      const double c = std::sin(l.theta) * slice.x[p] + std::cos(l.theta) * slice.z[p];
      sum += part[k] = std::exp(l.log_weight + l.log_kappa + kappa * (c - 1));
    }
    const double reflected = slice.weight[p] * slice.value[p];
    for (int k = 0; k < m.lobes; ++k) {
      mass[k] += reflected * part[k] / sum;
      schlick[k] += reflected * part[k] / sum * slice.schlick[p];
    }
    schlick_albedo += reflected * slice.schlick[p];
  }
  std::array<double, kMaxBrdfLobes> share{};
  for (int k = 0; k < m.lobes; ++k)
    share[k] = mass[k] > 0 ? schlick[k] / mass[k] : schlick_albedo / slice.albedo;
  return share;
}

// Splits the lobes' weights into scale and bias; both sums are the slice's.
void SplitFresnel(const SliceQuadrature& slice, const SliceMixture& m, BrdfSlice& out) {
  double wanted = 0, got = 0, total = 0;
  const auto share = SchlickShares(slice, m, wanted);
  std::array<double, kMaxBrdfLobes> weight{};
  for (int k = 0; k < m.lobes; ++k) {
    weight[k] = out.lobe[k].above * std::exp(m.lobe[k].log_weight);
    total += weight[k];
    got += weight[k] * share[k];
  }
  for (int k = 0; k < m.lobes; ++k) {
    // Towards zero or towards one, whichever side the sum is off, so that a share stays in [0, 1].
    const double corrected = got >= wanted ? share[k] * (got > 0 ? wanted / got : 0)
                                           : 1 - (1 - share[k]) * (total - wanted) / (total - got);
    out.lobe[k].bias = static_cast<float>(weight[k] * corrected);
    out.lobe[k].scale = static_cast<float>(weight[k] * (1 - corrected));
  }
}

BrdfSlice ToSlice(BrdfModel model, const SliceQuadrature& slice, const SliceMixture& m) {
  BrdfSlice out;
  out.lobes = m.lobes;
  for (int k = 0; k < m.lobes; ++k) {
    const auto& from = m.lobe[k];
    BrdfLobe& lobe = out.lobe[k];
    const double kappa = std::exp(from.log_kappa), above = PartAbove(from.theta, kappa);
    lobe.mu_x = static_cast<float>(std::sin(from.theta));
    lobe.mu_z = static_cast<float>(std::cos(from.theta));
    lobe.kappa = static_cast<float>(kappa);
    lobe.above = static_cast<float>(std::max(above, 1e-6));
    lobe.scale = static_cast<float>(above * std::exp(from.log_weight));
  }
  if (model == BrdfModel::kGgx) SplitFresnel(slice, m, out);
  return out;
}

void MeasureSlice(const SliceQuadrature& slice, const SliceMixture& m, double share, const BrdfSlice& out,
                  BrdfFitError& error) {
  double whole = 0, kept = 0;
  for (int k = 0; k < out.lobes; ++k) {
    const double weight = double{out.lobe[k].scale} + out.lobe[k].bias;
    kept += weight;
    whole += weight / out.lobe[k].above;
  }
  const double l2 = RelativeL2(slice, m);
  error.mean_l2 += static_cast<float>(share * l2);
  error.max_l2 = std::max(error.max_l2, static_cast<float>(l2));
  error.max_albedo = std::max(error.max_albedo, static_cast<float>(std::abs(kept / slice.albedo - 1)));
  error.max_below_horizon = std::max(error.max_below_horizon, static_cast<float>(1 - kept / whole));
}

}  // namespace

BrdfShape FitBrdfShape(BrdfModel model, float shape, const BrdfFitOptions& options) {
  std::vector<SliceQuadrature> slices;
  slices.reserve(kElevationNodes);
  for (int i = 0; i < kElevationNodes; ++i)
    slices.push_back(MakeSliceQuadrature(model, shape, NodeCosine(i)));
  const int lobes = ChooseLobes(slices, options);
  const std::vector<SliceMixture> fits = FitElevations(slices, lobes, 1);
  BrdfShape result{model, shape, lobes, {}, {}};
  result.slices.reserve(kElevationNodes);
  for (int i = 0; i < kElevationNodes; ++i) {
    result.slices.push_back(ToSlice(model, slices[i], fits[i]));
    MeasureSlice(slices[i], fits[i], NodeShare(i), result.slices.back(), result.error);
  }
  return result;
}

}  // namespace glint
