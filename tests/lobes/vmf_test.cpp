#include "common/lobes/vmf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "common/base/frame.h"
#include "common/base/rng.h"
#include "tests/lobes/chi_square.h"

namespace glint {
namespace {

constexpr long double kPiL = 3.14159265358979323846264338327950288L;

// The mean cosine and 1 - it in extended precision: closed forms where they keep digits, the series
// elsewhere.
long double MeanCosineL(long double k) {
  if (k < 0.02L) return k / 3 - k * k * k / 45 + 2 * k * k * k * k * k / 945;
  return 1 / std::tanh(k) - 1 / k;
}
long double DeltaL(long double k) { return k < 0.02L ? 1 - MeanCosineL(k) : 1 / k - 2 / std::expm1(2 * k); }

// The inverse of a monotone function by bisection on log kappa.
template <class F>
long double Invert(F below) {
  long double lo = std::log(1e-12L), hi = std::log(1e9L);
  for (int i = 0; i < 90; ++i) {
    const long double mid = (lo + hi) / 2;
    (below(std::exp(mid)) ? lo : hi) = mid;
  }
  return std::exp(lo);
}

std::vector<float> Kappas() {
  std::vector<float> kappas;
  for (double e = -6; e <= 5.0001; e += 0.01) kappas.push_back(static_cast<float>(std::pow(10.0, e)));
  return kappas;
}

glm::vec3 RandomDirection(CounterRng& rng) { return SampleVmf({}, rng.Uniform(), rng.Uniform()); }

float RandomKappa(CounterRng& rng) { return std::pow(10.0f, 8 * rng.Uniform() - 3); }

// A unit direction at a given angle from mu; exact to float rounding however small the angle.
glm::vec3 Tilted(const glm::vec3& mu, double angle) {
  const glm::vec3 side =
      glm::normalize(glm::cross(mu, std::abs(mu.x) < 0.5f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0)));
  return glm::normalize(mu * static_cast<float>(std::cos(angle)) +
                        side * static_cast<float>(std::sin(angle)));
}

TEST(VmfTest, DeltaIsExactInFloat) {
  for (const float k : Kappas()) {
    EXPECT_NEAR(DeltaFromKappa(k) / DeltaL(k), 1, 1e-6) << k;
    EXPECT_NEAR(MeanCosineFromKappa(k) / MeanCosineL(k), 1, 1e-6) << k;
  }
}

TEST(VmfTest, KappaIsTheExactInverse) {
  for (const float k : Kappas()) {
    const float delta = DeltaFromKappa(k);
    if (delta < 1) {
      const long double exact = Invert([&](long double x) { return DeltaL(x) > delta; });
      EXPECT_NEAR(KappaFromDelta(delta) / exact, 1, 1e-6) << k;
    }
    const float r = MeanCosineFromKappa(k);
    const long double exact = Invert([&](long double x) { return MeanCosineL(x) < r; });
    EXPECT_NEAR(KappaFromMeanCosine(r) / exact, 1, 1e-6) << k;
  }
}

TEST(VmfTest, KappaRoundTrip) {
  for (const float k : Kappas()) {
    const float through_delta = KappaFromDelta(DeltaFromKappa(k));
    if (k >= 0.3f) {
      EXPECT_NEAR(through_delta / k, 1, 1e-6) << k;
    }
    if (k < 0.3f) {
      EXPECT_NEAR(through_delta, k, 3e-7) << k;
    }
    if (k < 0.5f) {
      EXPECT_NEAR(KappaFromMeanCosine(MeanCosineFromKappa(k)) / k, 1, 1e-6) << k;
    }
  }
}

TEST(VmfTest, LimitsAreDefined) {
  EXPECT_EQ(DeltaFromKappa(0), 1);
  EXPECT_EQ(MeanCosineFromKappa(0), 0);
  EXPECT_EQ(KappaFromDelta(1), 0);
  EXPECT_EQ(KappaFromDelta(2), 0);
  EXPECT_EQ(KappaFromDelta(0), kMaxKappa);
  EXPECT_EQ(KappaFromMeanCosine(0), 0);
  EXPECT_EQ(KappaFromMeanCosine(1), kMaxKappa);
  EXPECT_NEAR(DeltaFromKappa(kMaxKappa) * kMaxKappa, 1, 1e-6);
  EXPECT_EQ(KappaFromDelta(std::numeric_limits<float>::quiet_NaN()), 0);
  EXPECT_FLOAT_EQ(VmfNormalization(0), static_cast<float>(1 / (4 * kPiL)));
  EXPECT_FLOAT_EQ(VmfNormalization(1e-20f), static_cast<float>(1 / (4 * kPiL)));
}

TEST(VmfTest, KappaGrowsWithSharpness) {
  float last = kMaxKappa;
  for (float delta = 1e-6f; delta < 1; delta *= 1.0001f) {
    const float kappa = KappaFromDelta(delta);
    EXPECT_LE(kappa, last * (1 + 2e-7f)) << delta;
    last = kappa;
  }
}

TEST(VmfTest, DensityIntegratesToOne) {
  for (const float kappa : {0.0f, 1e-4f, 0.1f, 1.0f, 30.0f, 1e3f, 1e5f, 1e6f}) {
    // Over w = 1 - cos, in log w, where every sharpness is well resolved.
    double sum = 0;
    const double lo = std::log(1e-12), hi = std::log(2.0), step = (hi - lo) / 4000;
    for (double l = lo + step / 2; l < hi; l += step) {
      const double w = std::exp(l);
      const float sin_theta = static_cast<float>(std::sqrt(w * (2 - w)));
      sum += VmfPdf({{0, 0, 1}, kappa}, {sin_theta, 0, static_cast<float>(1 - w)}) * w * step * 2 * kPiL;
    }
    EXPECT_NEAR(sum, 1, 1e-4) << kappa;
  }
}

TEST(VmfTest, SamplesFollowTheDensity) {
  const glm::vec3 mu = glm::normalize(glm::vec3(0.3f, -0.5f, 0.2f));
  for (const float kappa : {0.0f, 1e-3f, 0.2f, 3.0f, 80.0f, 5e3f, 1e6f}) {
    const Vmf lobe{mu, kappa};
    CounterRng rng(7, 1);
    const auto sample = [&] { return SampleVmf(lobe, rng.Uniform(), rng.Uniform()); };
    const auto pdf = [&](const glm::vec3& s) { return VmfPdf(lobe, s); };
    EXPECT_GT(ChiSquareOfSphere(mu, kappa, 20000, sample, pdf), 1e-3) << kappa;
  }
}

TEST(VmfTest, SamplesAreUnitAtEveryCorner) {
  for (const float kappa : {0.0f, 1e-35f, 1e-8f, 1e-3f, 1.0f, 100.0f, kMaxKappa})
    for (const float u : {0.0f, 1e-30f, 1e-7f, 0.5f, 0.9999999f, 1.0f})
      for (const glm::vec3 mu : {glm::vec3(0, 0, 1), glm::vec3(0, 0, -1), glm::vec3(1, 0, 0)}) {
        const glm::vec3 s = SampleVmf({mu, kappa}, u, 0.3f);
        EXPECT_NEAR(glm::length(s), 1, 1e-6) << kappa << " " << u;
      }
}

TEST(VmfTest, MergeKeepsTheMomentsOfTheMixture) {
  CounterRng rng(11, 2);
  for (int trial = 0; trial < 300; ++trial) {
    VmfMoments moments;
    glm::dvec3 sum{0};
    double weight = 0;
    for (int i = 0; i < 5; ++i) {
      const double w = rng.Uniform();
      const Vmf lobe{RandomDirection(rng), RandomKappa(rng)};
      moments.Add(w, lobe);
      sum += w * static_cast<double>(1 - DeltaL(lobe.kappa)) * glm::normalize(glm::dvec3(lobe.mu));
      weight += w;
    }
    const Vmf merged = moments.Lobe();
    const glm::dvec3 mean = sum / weight;
    const double r = glm::length(mean);
    EXPECT_NEAR(MeanCosineFromKappa(merged.kappa), r, 1e-6);
    EXPECT_NEAR(glm::dot(glm::dvec3(merged.mu), mean) / r, 1, 1e-6);
  }
}

TEST(VmfTest, MergeOfEqualLobesIsThatLobe) {
  CounterRng rng(12, 2);
  for (int trial = 0; trial < 300; ++trial) {
    const Vmf lobe{RandomDirection(rng), RandomKappa(rng)};
    VmfMoments a, b;
    a.Add(0.25, lobe);
    b.Add(3, lobe);
    a += b;
    const Vmf merged = a.Lobe();
    EXPECT_NEAR(merged.kappa, lobe.kappa, 1e-6f * lobe.kappa + 1e-6f);
    if (lobe.kappa > 1e-3f) {
      EXPECT_NEAR(glm::distance(merged.mu, lobe.mu), 0, 3e-7);
    }
    EXPECT_DOUBLE_EQ(a.weight, 3.25);
  }
}

TEST(VmfTest, MergeOfDirectionsKeepsWidthNearTheLimit) {
  // A ring of directions at half-angle 2e-3: delta = 1 - cos(2e-3), which a float mean cosine could not hold.
  const glm::vec3 mu = glm::normalize(glm::vec3(1, 2, -3));
  const double angle = 2e-3;
  const Frame frame = Frame::FromNormal(mu);
  VmfMoments moments;
  for (int i = 0; i < 64; ++i) {
    const float phi = 2 * kPi * static_cast<float>(i) / 64;
    const float c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
    moments.AddDirection(1, glm::normalize(frame.ToWorld({s * std::cos(phi), s * std::sin(phi), c})));
  }
  EXPECT_NEAR(moments.Lobe().kappa * (1 - std::cos(angle)), 1, 1e-3);
}

TEST(VmfTest, MergesWithoutAnAnswerHaveADefinedOne) {
  const glm::vec3 mu = glm::normalize(glm::vec3(1, 1, 0.2f));
  for (const float kappa : {0.0f, 1.0f, 1e3f, kMaxKappa}) {
    VmfMoments moments;
    moments.Add(0.7, {mu, kappa});
    moments.Add(0.7, {-mu, kappa});
    const Vmf merged = moments.Lobe();
    EXPECT_EQ(merged.kappa, 0) << kappa;
    EXPECT_EQ(merged.mu, glm::vec3(0, 0, 1)) << kappa;
  }
  EXPECT_EQ(VmfMoments{}.Lobe().kappa, 0);
  EXPECT_EQ(LobeFromMean({0, 0, 0}).kappa, 0);
  VmfMoments single;
  single.AddDirection(1, mu);
  EXPECT_EQ(single.Lobe().kappa, kMaxKappa);
  EXPECT_NEAR(glm::distance(single.Lobe().mu, mu), 0, 1e-6);
  EXPECT_EQ(LobeFromMean({0, 1, 0}).kappa, kMaxKappa);
}

// gamma0 gamma1 over the sphere, in a polar grid around lobe 0 that is fine where either is.
double InnerProductByQuadrature(const Vmf& l0, const Vmf& l1) {
  const Frame frame = Frame::FromNormal(l0.mu);
  double sum = 0;
  const int rings = 800, sectors = 128;
  const double width = 80.0 / (l0.kappa + 20);  // 1 - cos up to where e^(-kappa w) has vanished
  for (int i = 0; i < rings; ++i) {
    const double t = (i + 0.5) / rings, top = std::min(2.0, width);
    const double w = top * t * t, dw = top * 2 * t / rings;
    for (int j = 0; j < sectors; ++j) {
      const double phi = 2 * kPi * (j + 0.5) / sectors, sin_theta = std::sqrt(w * (2 - w));
      const glm::vec3 s = frame.ToWorld({sin_theta * std::cos(phi), sin_theta * std::sin(phi), 1 - w});
      sum += static_cast<double>(VmfPdf(l0, s)) * VmfPdf(l1, s) * dw * 2 * kPi / sectors;
    }
  }
  return sum;
}

TEST(VmfTest, InnerProductMatchesQuadrature) {
  const glm::vec3 mu = glm::normalize(glm::vec3(-0.2f, 0.4f, 0.7f));
  for (const float k0 : {0.0f, 0.5f, 20.0f, 900.0f})
    for (const float k1 : {0.0f, 1.0f, 25.0f})
      for (const double angle : {0.0, 0.2, 1.0, 3.14159265}) {
        const Vmf l0{mu, k0}, l1{Tilted(mu, angle), k1};
        const double exact = InnerProductByQuadrature(l0, l1);
        EXPECT_NEAR(VmfInnerProduct(l0, l1), exact, 1e-3 * exact + 1e-7) << k0 << " " << k1 << " " << angle;
      }
}

TEST(VmfTest, DistanceMatchesInnerProducts) {
  CounterRng rng(3, 4);
  for (int trial = 0; trial < 500; ++trial) {
    const Vmf l0{RandomDirection(rng), RandomKappa(rng)}, l1{RandomDirection(rng), RandomKappa(rng)};
    const float w0 = rng.Uniform(), w1 = rng.Uniform();
    const double i00 = VmfInnerProduct(l0, l0), i11 = VmfInnerProduct(l1, l1), i01 = VmfInnerProduct(l0, l1);
    const double expanded = w0 * w0 * i00 + w1 * w1 * i11 - 2.0 * w0 * w1 * i01;
    EXPECT_NEAR(VmfDistance2(w0, l0, w1, l1), expanded, 1e-6 * (w0 * w0 * i00 + w1 * w1 * i11));
    EXPECT_NEAR(VmfDistance2(w0, l0, w1, l1), VmfDistance2(w1, l1, w0, l0), 1e-6 * expanded);
  }
}

// equations.md's form in extended precision, where its cancellation does no harm.
long double DistanceL(const Vmf& l0, const Vmf& l1) {
  const auto unit = [](const glm::vec3& m, long double(&out)[3]) {
    const long double n =
        std::sqrt((long double){m.x} * m.x + (long double){m.y} * m.y + (long double){m.z} * m.z);
    out[0] = m.x / n, out[1] = m.y / n, out[2] = m.z / n;
  };
  long double a[3], b[3], h = 0;
  unit(l0.mu, a);
  unit(l1.mu, b);
  for (int i = 0; i < 3; ++i) h += (a[i] - b[i]) * (a[i] - b[i]) / 2;
  const long double k0 = l0.kappa, k1 = l1.kappa, sum = k0 + k1;
  const long double q = 2 * k0 * k1 * h, kc = std::sqrt(sum * sum - q);
  const long double t = q / (sum + kc);
  const auto self = [](long double k) { return k / std::tanh(k) / (4 * kPiL); };
  return self(k0) + self(k1) -
         k0 * k1 / (kPiL * kc) * std::exp(-t) * -std::expm1(-2 * kc) /
             (std::expm1(-2 * k0) * std::expm1(-2 * k1));
}

TEST(VmfTest, DistanceOfCloseLobesKeepsItsDigits) {
  const glm::vec3 mu = glm::normalize(glm::vec3(0.5f, -0.1f, 0.8f));
  for (const float kappa : {0.5f, 3.0f, 60.0f, 2e3f, 1e5f})
    for (const double angle : {1e-4, 1e-3, 1e-2})
      for (const float ratio : {1.0f, 1.001f, 1.1f}) {
        const Vmf l0{mu, kappa}, l1{Tilted(mu, angle), kappa * ratio};
        const double exact = static_cast<double>(DistanceL(l0, l1));
        EXPECT_NEAR(VmfDistance2(1, l0, 1, l1) / exact, 1, 1e-3) << kappa << " " << angle << " " << ratio;
      }
}

TEST(VmfTest, DistanceIsDefinedAtEveryLimit) {
  const glm::vec3 mu(0, 0, 1);
  for (const float k0 : {0.0f, 1e-30f, 1.0f, kMaxKappa})
    for (const float k1 : {0.0f, 1e-30f, 1.0f, kMaxKappa})
      for (const glm::vec3 other : {mu, -mu, glm::vec3(1, 0, 0)}) {
        const float d = VmfDistance2(1, {mu, k0}, 1, {other, k1});
        EXPECT_TRUE(std::isfinite(d)) << k0 << " " << k1;
        EXPECT_GE(d, 0);
        EXPECT_TRUE(std::isfinite(VmfInnerProduct({mu, k0}, {other, k1}))) << k0 << " " << k1;
      }
  EXPECT_EQ(VmfDistance2(1, {mu, 50}, 1, {mu, 50}), 0);
  EXPECT_EQ(VmfDistance2(0, {mu, 50}, 0, {-mu, 3}), 0);
  EXPECT_NEAR(VmfDistance2(2, {mu, 0}, 0, {mu, 9}), 4 / (4 * kPi), 1e-6);
}

}  // namespace
}  // namespace glint
