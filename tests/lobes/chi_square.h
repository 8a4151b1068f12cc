#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "common/base/frame.h"

namespace glint {

/// Probability that a chi-square variable with `dof` degrees of freedom exceeds x: the regularised upper
/// incomplete gamma function Q(dof/2, x/2), by its series and its continued fraction.
inline double ChiSquareTail(double x, int dof) {
  const double a = dof / 2.0, z = x / 2;
  if (z <= 0) return 1;
  const double front = std::exp(a * std::log(z) - z - std::lgamma(a));
  if (z < a + 1) {
    double term = 1 / a, sum = term;
    for (int i = 1; i < 2000 && term > 1e-14 * sum; ++i) sum += term *= z / (a + i);
    return 1 - front * sum;
  }
  double b = z + 1 - a, c = 1e300, d = 1 / b, h = d;
  for (int i = 1; i < 2000; ++i) {
    const double an = -i * (i - a);
    b += 2;
    d = 1 / (an * d + b);
    c = b + an / c;
    const double factor = d * c;
    h *= factor;
    if (std::abs(factor - 1) < 1e-12) break;
  }
  return front * h;
}

/// Chi-square test of `sample` (unit directions, or (0,0,0) for "no sample") against `pdf` (1/sr): the
/// probability of a deviation at least this large if they agree. Cells are rings about `axis`, even in log(1
/// + w / w0), w = 1 - cos, w0 = 1 / (4 kappa), times sectors, so that lobes of any width down to that of
/// `kappa` are resolved, mixed or not. What cells expect is integrated from `pdf`, and what it lacks to one
/// must be the part without a sample. Cells that expect fewer than five are pooled.
template <class Sample, class Pdf>
double ChiSquareOfSphere(const glm::vec3& axis, float kappa, int count, const Sample& sample,
                         const Pdf& pdf) {
  constexpr int kRings = 12, kSectors = 16, kFineRings = 16, kFineSectors = 10;
  const Frame frame = Frame::FromNormal(axis);
  const double w0 = 1 / (4 * std::max(0.25, static_cast<double>(kappa))), range = std::log1p(2 / w0);

  std::vector<double> observed(kRings * kSectors + 1, 0.0), expected(kRings * kSectors + 1, 0.0);
  for (int i = 0; i < count; ++i) {
    const glm::vec3 s = sample();
    if (glm::dot(s, s) < 0.5f) {
      observed.back() += 1;
      continue;
    }
    const glm::dvec3 chord = glm::dvec3(s) - glm::dvec3(axis);
    const double t = std::log1p(glm::dot(chord, chord) / 2 / w0) / range;
    const glm::vec3 local = frame.ToLocal(s);
    const double phi = std::atan2(local.y, local.x) / (2 * kPi);
    const int ring = std::clamp(static_cast<int>(t * kRings), 0, kRings - 1);
    const int sector = std::clamp(static_cast<int>((phi < 0 ? phi + 1 : phi) * kSectors), 0, kSectors - 1);
    observed[ring * kSectors + sector] += 1;
  }
  double total = 0;
  for (int i = 0; i < kRings * kFineRings; ++i) {
    const double t = (i + 0.5) / (kRings * kFineRings), w = w0 * std::expm1(t * range);
    const double strip =
        (w + w0) * range / (kRings * kFineRings) * 2 * kPi / (kSectors * kFineSectors) * count;
    const double sin_theta = std::sqrt(std::max(0.0, w * (2 - w)));
    for (int j = 0; j < kSectors * kFineSectors; ++j) {
      const double phi = 2 * kPi * (j + 0.5) / (kSectors * kFineSectors);
      const glm::dvec3 local{sin_theta * std::cos(phi), sin_theta * std::sin(phi), 1 - w};
      const double mass = strip * pdf(frame.ToWorld(glm::vec3(local)));
      expected[i / kFineRings * kSectors + j / kFineSectors] += mass;
      total += mass;
    }
  }
  expected.back() = std::max(0.0, count - total);
  double statistic = 0, pooled_observed = 0, pooled_expected = 0;
  int cells = 0;
  for (size_t i = 0; i < observed.size(); ++i) {
    if (expected[i] < 5) {
      pooled_observed += observed[i];
      pooled_expected += expected[i];
      continue;
    }
    statistic += (observed[i] - expected[i]) * (observed[i] - expected[i]) / expected[i];
    ++cells;
  }
  if (pooled_expected > 5) {
    statistic += (pooled_observed - pooled_expected) * (pooled_observed - pooled_expected) / pooled_expected;
    ++cells;
  } else if (pooled_observed > 25) {
    return 0;  // samples where the density says there are none
  }
  return ChiSquareTail(statistic, cells - 1);
}

}  // namespace glint
