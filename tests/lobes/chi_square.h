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
/// probability of a deviation at least this large if they agree. Cells are equally likely under the vMF lobe
/// (axis, kappa), so that a sharp density is resolved; what the cells expect is integrated from `pdf`, and
/// what it lacks to one must be the part without a sample. Cells that expect fewer than five are pooled.
template <class Sample, class Pdf>
double ChiSquareOfSphere(const glm::vec3& axis, float kappa, int count, const Sample& sample,
                         const Pdf& pdf) {
  constexpr int kRings = 12, kSectors = 16, kFine = 12;
  const Frame frame = Frame::FromNormal(axis);
  // u in (0, 1) of w = 1 - cos theta: the lobe's cumulative distribution, and its inverse.
  const double e = std::expm1(-2.0 * kappa);
  const auto cumulative = [&](double w) { return kappa > 1e-6f ? std::expm1(-kappa * w) / e : w / 2; };
  const auto inverse = [&](double u) { return kappa > 1e-6f ? -std::log1p(u * e) / kappa : 2 * u; };

  std::vector<double> observed(kRings * kSectors + 1, 0.0), expected(kRings * kSectors + 1, 0.0);
  for (int i = 0; i < count; ++i) {
    const glm::vec3 s = sample();
    if (glm::dot(s, s) < 0.5f) {
      observed.back() += 1;
      continue;
    }
    const glm::dvec3 chord = glm::dvec3(s) - glm::dvec3(axis);
    const double w = glm::dot(chord, chord) / 2;
    const glm::vec3 local = frame.ToLocal(s);
    const double phi = std::atan2(local.y, local.x) / (2 * kPi);
    const int ring = std::clamp(static_cast<int>(cumulative(w) * kRings), 0, kRings - 1);
    const int sector = std::clamp(static_cast<int>((phi < 0 ? phi + 1 : phi) * kSectors), 0, kSectors - 1);
    observed[ring * kSectors + sector] += 1;
  }
  double total = 0;
  for (int ring = 0; ring < kRings; ++ring)
    for (int fine = 0; fine < kFine; ++fine) {
      const double u0 = (ring + static_cast<double>(fine) / kFine) / kRings;
      const double u1 = (ring + (fine + 1.0) / kFine) / kRings;
      const double w0 = inverse(u0), w1 = u1 < 1 ? inverse(u1) : 2.0;
      // Two Gauss points a strip; the outermost strip of a sharp lobe is long and empty.
      for (const double t : {0.2113248654, 0.7886751346}) {
        const double w = u1 < 1 ? w0 + t * (w1 - w0) : inverse(u0 + t * (u1 - u0));
        const double density =
            u1 < 1 ? (w1 - w0) / 2
                   : (u1 - u0) / 2 * -e / std::max(1e-300, static_cast<double>(kappa)) * std::exp(kappa * w);
        const double weight = kappa > 1e-6f ? density : (w1 - w0) / 2;
        const double sin_theta = std::sqrt(std::max(0.0, w * (2 - w)));
        for (int k = 0; k < kSectors * kFine; ++k) {
          const double phi = 2 * kPi * (k + 0.5) / (kSectors * kFine);
          const glm::dvec3 local{sin_theta * std::cos(phi), sin_theta * std::sin(phi), 1 - w};
          const double mass =
              pdf(frame.ToWorld(glm::vec3(local))) * weight * 2 * kPi / (kSectors * kFine) * count;
          expected[ring * kSectors + k / kFine] += mass;
          total += mass;
        }
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
