#include "common/lobes/slice_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "common/lobes/vmf.h"

namespace glint {
namespace {

constexpr double kPiD = std::numbers::pi;
constexpr double kMinLogKappa = -2.3;  // kappa 0.1 is as good as uniform
constexpr double kMinLogWeight = -30;
// Residual per unit of a parameter's way from the start, relative to the slice's norm.
constexpr double kPull = 2e-3;
// Weight of the albedo constraint, relative to the slice's norm per relative albedo.
constexpr double kAlbedoWeight = 3;

// Relative gain of a step below which a fit is done.
constexpr double kConverged = 1e-3;

constexpr int kPerLobe = 3;
constexpr int kMaxParameters = kPerLobe * kMaxBrdfLobes;

// One lobe made ready for evaluation.
struct Prepared {
  double x, z, kappa;  // mu and sharpness
  double factor;       // weight times normalisation
  double d_log_kappa;  // d log normalisation / d log kappa
};

Prepared Prepare(const SliceMixture::Lobe& lobe) {
  const double kappa = std::exp(lobe.log_kappa), tail = -std::expm1(-2 * kappa);
  return {std::sin(lobe.theta), std::cos(lobe.theta), kappa,
          std::exp(lobe.log_weight) * kappa / (2 * kPiD * tail), 1 - 2 * kappa * (1 - tail) / tail};
}

// The normal equations of the least squares problem at one mixture.
struct NormalEquations {
  std::array<std::array<double, kMaxParameters>, kMaxParameters> jtj{};  // lower triangle
  std::array<double, kMaxParameters> jtr{};
  double cost = 0;

  void AddRow(const std::array<double, kMaxParameters>& row, double residual, int n) {
    cost += residual * residual;
    for (int a = 0; a < n; ++a) {
      jtr[a] += row[a] * residual;
      for (int b = 0; b <= a; ++b) jtj[a][b] += row[a] * row[b];
    }
  }
};

void AddConstraint(const SliceQuadrature& slice, const SliceMixture& m, NormalEquations& out) {
  constexpr double kStep = 1e-4;
  const double scale = kAlbedoWeight * std::sqrt(slice.norm2) / slice.albedo;
  std::array<double, kMaxParameters> row{};
  double above = 0;
  for (int k = 0; k < m.lobes; ++k) {
    const auto& lobe = m.lobe[k];
    const double weight = std::exp(lobe.log_weight), kappa = std::exp(lobe.log_kappa);
    const double part = PartAbove(lobe.theta, kappa);
    above += weight * part;
    row[kPerLobe * k] = scale * weight * (PartAbove(lobe.theta + kStep, kappa) - part) / kStep;
    row[kPerLobe * k + 1] = scale * weight * (PartAbove(lobe.theta, kappa * (1 + kStep)) - part) / kStep;
    row[kPerLobe * k + 2] = scale * weight * part;
  }
  out.AddRow(row, scale * (above - slice.albedo), kPerLobe * m.lobes);
}

// Distance from the start, angles in units of the lobe's width.
void AddPull(const SliceQuadrature& slice, const SliceMixture& m, const SliceMixture& start,
             NormalEquations& out) {
  const double pull = kPull * std::sqrt(slice.norm2);
  for (int k = 0; k < m.lobes; ++k) {
    const auto &lobe = m.lobe[k], &from = start.lobe[k];
    const double unit = std::exp(from.log_kappa / 2);
    const std::array<double, kPerLobe> way = {
        unit * (lobe.theta - from.theta), lobe.log_kappa - from.log_kappa, lobe.log_weight - from.log_weight};
    for (int i = 0; i < kPerLobe; ++i) {
      const double d = pull * (i == 0 ? unit : 1);
      out.cost += pull * pull * way[i] * way[i];
      out.jtr[kPerLobe * k + i] += d * pull * way[i];
      out.jtj[kPerLobe * k + i][kPerLobe * k + i] += d * d;
    }
  }
}

// Dot product in four chains, so that it neither waits for each addition nor depends on the compiler's order.
double Dot(const double* a, const double* b, size_t n) {
  std::array<double, 4> sum{};
  size_t i = 0;
  for (; i + 4 <= n; i += 4)
    for (size_t c = 0; c < 4; ++c) sum[c] += a[i + c] * b[i + c];
  for (; i < n; ++i) sum[0] += a[i] * b[i];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

// Jacobian by columns, the residual last; points are in rows and scaled with the root of their weight.
std::vector<double> Jacobian(const SliceQuadrature& slice, const SliceMixture& m) {
  const size_t points = slice.value.size();
  std::vector<double> columns(points * (kPerLobe * m.lobes + 1));
  double* residual = columns.data() + points * kPerLobe * m.lobes;
  for (size_t p = 0; p < points; ++p) residual[p] = -slice.root_weight[p] * slice.value[p];
  for (int k = 0; k < m.lobes; ++k) {
    const Prepared l = Prepare(m.lobe[k]);
    double *d_theta = columns.data() + points * kPerLobe * k, *d_kappa = d_theta + points,
           *d_weight = d_kappa + points;
    for (size_t p = 0; p < points; ++p) {
      const double x = slice.x[p], z = slice.z[p], exponent = l.kappa * (l.x * x + l.z * z - 1);
      const double value = slice.root_weight[p] * l.factor * std::exp(exponent);
      d_theta[p] = value * l.kappa * (l.z * x - l.x * z);
      d_kappa[p] = value * (l.d_log_kappa + exponent);
      d_weight[p] = value;
      residual[p] += value;
    }
  }
  return columns;
}

NormalEquations Linearize(const SliceQuadrature& slice, const SliceMixture& m, const SliceMixture& start) {
  const size_t points = slice.value.size();
  const int n = kPerLobe * m.lobes;
  const std::vector<double> columns = Jacobian(slice, m);
  const double* residual = columns.data() + points * n;
  NormalEquations out;
  out.cost = Dot(residual, residual, points);
  for (int a = 0; a < n; ++a) {
    const double* column = columns.data() + points * a;
    out.jtr[a] = Dot(column, residual, points);
    for (int b = 0; b <= a; ++b) out.jtj[a][b] = Dot(column, columns.data() + points * b, points);
  }
  AddConstraint(slice, m, out);
  AddPull(slice, m, start, out);
  return out;
}

// Solves (jtj + damping * diagonal) step = -jtr by Cholesky; false where that is not positive definite.
bool SolveDamped(const NormalEquations& e, int n, double damping, std::array<double, kMaxParameters>& step) {
  auto l = e.jtj;
  for (int a = 0; a < n; ++a) {
    l[a][a] *= 1 + damping;
    for (int b = 0; b <= a; ++b) {
      double sum = l[a][b];
      for (int c = 0; c < b; ++c) sum -= l[a][c] * l[b][c];
      if (a == b && !(sum > 0)) return false;
      l[a][b] = a == b ? std::sqrt(sum) : sum / l[b][b];
    }
  }
  for (int a = 0; a < n; ++a) {
    double sum = -e.jtr[a];
    for (int c = 0; c < a; ++c) sum -= l[a][c] * step[c];
    step[a] = sum / l[a][a];
  }
  for (int a = n - 1; a >= 0; --a) {
    for (int c = a + 1; c < n; ++c) step[a] -= l[c][a] * step[c];
    step[a] /= l[a][a];
  }
  return true;
}

SliceMixture Moved(const SliceMixture& m, const std::array<double, kMaxParameters>& step) {
  SliceMixture out = m;
  for (int k = 0; k < m.lobes; ++k) {
    auto& lobe = out.lobe[k];
    // No step turns a lobe by more than its width, or changes it by more than e.
    const double width = std::min(0.3, std::exp(-lobe.log_kappa / 2));
    lobe.theta += std::clamp(step[kPerLobe * k], -width, width);
    lobe.log_kappa += std::clamp(step[kPerLobe * k + 1], -1.0, 1.0);
    lobe.log_weight += std::clamp(step[kPerLobe * k + 2], -1.0, 1.0);
    lobe.theta = std::clamp(lobe.theta, -0.6 * kPiD, 0.6 * kPiD);
    lobe.log_kappa = std::clamp(lobe.log_kappa, kMinLogKappa, std::log(double{kMaxKappa}));
    lobe.log_weight = std::max(lobe.log_weight, kMinLogWeight);
  }
  return out;
}

// All weights by one factor, so that the parts above the surface sum to the slice's albedo.
void KeepAlbedo(const SliceQuadrature& slice, SliceMixture& m) {
  double above = 0;
  for (int k = 0; k < m.lobes; ++k)
    above += std::exp(m.lobe[k].log_weight) * PartAbove(m.lobe[k].theta, std::exp(m.lobe[k].log_kappa));
  const double shift = std::log(slice.albedo / std::max(1e-300, above));
  for (int k = 0; k < m.lobes; ++k) m.lobe[k].log_weight += shift;
}

// One round of expectation-maximisation: points shared among lobes by what each explains, lobes from their
// moments.
void ExpectMaximize(const SliceQuadrature& slice, SliceMixture& m) {
  struct Moments {
    double weight = 0, x = 0, z = 0;
  };
  std::array<Prepared, kMaxBrdfLobes> lobes{};
  std::array<Moments, kMaxBrdfLobes> moments{};
  for (int k = 0; k < m.lobes; ++k) lobes[k] = Prepare(m.lobe[k]);
  for (size_t p = 0; p < slice.value.size(); ++p) {
    std::array<double, kMaxBrdfLobes> part{};
    double sum = 1e-300;
    for (int k = 0; k < m.lobes; ++k) {
      const Prepared& l = lobes[k];
      sum += part[k] = l.factor * std::exp(l.kappa * (l.x * slice.x[p] + l.z * slice.z[p] - 1));
    }
    for (int k = 0; k < m.lobes; ++k) {
      const double w = slice.weight[p] * slice.value[p] * part[k] / sum;
      moments[k].weight += w;
      moments[k].x += w * slice.x[p];
      moments[k].z += w * slice.z[p];
    }
  }
  for (int k = 0; k < m.lobes; ++k) {
    const Moments& s = moments[k];
    if (!(s.weight > 1e-12 * slice.albedo)) continue;
    const double r = std::min(std::hypot(s.x, s.z) / s.weight, 1 - 0.5 / kMaxKappa);
    m.lobe[k] = {
        std::atan2(s.x, s.z),
        std::clamp(std::log(r * (3 - r * r) / (1 - r * r)), kMinLogKappa, std::log(double{kMaxKappa})),
        std::log(s.weight)};
  }
}

}  // namespace

double PartAbove(double theta, double kappa) {
  // In rings about mu at w = 1 - cos: those nearer than the surface lie on mu's side, those beyond its
  // reflection on the other, those between count by their arc above, cos_ring mu_z + sin_ring mu_x cos(phi) >
  // 0.
  const double mu_x = std::abs(std::sin(theta)), mu_z = std::cos(theta), tail = std::expm1(-2 * kappa);
  if (kappa * (1 - mu_x) > 12) return mu_z > 0 ? 1 : 0;  // all but e^-12
  const auto cumulative = [&](double w) { return std::expm1(-kappa * w) / tail; };
  const double near = cumulative(1 - mu_x), far = cumulative(1 + mu_x);
  constexpr int kRings = 24;
  double between = 0;
  for (int i = 0; i < kRings; ++i) {
    const double t =
        (i + 0.5) / kRings;  // the arc starts and ends like a root: steps shrink towards both ends
    const double u = near + (far - near) * t * t * (3 - 2 * t);
    const double w = -std::log1p(u * tail) / kappa, sin_ring = std::sqrt(std::max(0.0, w * (2 - w)));
    const double edge = -(1 - w) * mu_z / std::max(1e-12, sin_ring * mu_x);
    between += std::acos(std::clamp(edge, -1.0, 1.0)) * t * (1 - t);
  }
  return (mu_z > 0 ? near : 1 - far) + (far - near) * between * 6 / (kRings * kPiD);
}

SliceMixture StartMixture(const SliceQuadrature& slice, int lobes) {
  SliceMixture m;
  m.lobes = 1;
  m.lobe[0] = SliceMixture::Lobe{0, kMinLogKappa, 0};
  ExpectMaximize(slice, m);
  const auto mean = m.lobe[0];
  m.lobes = lobes;
  for (int k = 0; k < lobes; ++k)
    m.lobe[k] = SliceMixture::Lobe{mean.theta,
                                   std::max(kMinLogKappa, mean.log_kappa + 1.5 * (lobes - 1) / 2.0 - 1.5 * k),
                                   mean.log_weight - std::log(lobes)};
  for (int i = 0; i < 20; ++i) ExpectMaximize(slice, m);
  return m;
}

SliceMixture FitMixture(const SliceQuadrature& slice, const SliceMixture& start, int iterations) {
  SliceMixture best = start;
  KeepAlbedo(slice, best);
  const SliceMixture anchor = best;
  NormalEquations equations = Linearize(slice, best, anchor);
  double damping = 1e-3;
  for (int i = 0; i < iterations; ++i) {
    std::array<double, kMaxParameters> step{};
    if (!SolveDamped(equations, kPerLobe * best.lobes, damping, step)) break;
    const SliceMixture next = Moved(best, step);
    const NormalEquations there = Linearize(slice, next, anchor);
    if (!(there.cost < equations.cost)) {
      damping *= 8;
      continue;
    }
    const bool converged = there.cost > equations.cost * (1 - kConverged);
    best = next;
    equations = there;
    damping = std::max(1e-7, damping / 5);
    if (converged) break;
  }
  KeepAlbedo(slice, best);
  return best;
}

double RelativeL2(const SliceQuadrature& slice, const SliceMixture& mixture) {
  std::array<Prepared, kMaxBrdfLobes> lobes{};
  for (int k = 0; k < mixture.lobes; ++k) lobes[k] = Prepare(mixture.lobe[k]);
  double sum = 0;
  for (size_t p = 0; p < slice.value.size(); ++p) {
    double difference = -slice.value[p];
    for (int k = 0; k < mixture.lobes; ++k)
      difference += lobes[k].factor *
                    std::exp(lobes[k].kappa * (lobes[k].x * slice.x[p] + lobes[k].z * slice.z[p] - 1));
    sum += slice.weight[p] * difference * difference;
  }
  return std::sqrt(sum / slice.norm2);
}

}  // namespace glint
