// von Mises-Fisher lobes in the forms that keep their digits (docs/mathematics.md, "Lobes"). All
// transcendental work is in double: the values that callers hold are floats, and their last digits must be
// theirs, not ours.

#include "common/lobes/vmf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"

namespace glint {
namespace {

constexpr double kTwoPi = 6.283185307179586476925;

// A first moment shorter than this is the rounding of lobes that cancel: no direction is left in it.
constexpr double kNoDirection = 1e-7;

// Below this the closed form of the mean cosine loses digits and its series has them all.
constexpr double kSeriesKappa = 0.5;

// coth k - 1/k by its Taylor series, |error| < 1e-10 r at kSeriesKappa.
double MeanCosineSeries(double k) {
  const double k2 = k * k;
  return k * (1.0 / 3 +
              k2 * (-1.0 / 45 +
                    k2 * (2.0 / 945 + k2 * (-1.0 / 4725 + k2 * (2.0 / 93555 - k2 * 1382.0 / 638512875)))));
}

double Delta(double kappa) {
  if (kappa < kSeriesKappa) return 1 - MeanCosineSeries(kappa);
  return kappa > 20 ? 1 / kappa : 1 / kappa - 2 / std::expm1(2 * kappa);
}

// delta below which kappa = 1 / delta to 4e-8: 2 / (e^(2 kappa) - 1) has vanished.
constexpr double kSharpDelta = 0.1;

// kappa (1 - r^2) / r is smooth in r^2; this is its Chebyshev interpolant of degree 14 over r in [0, 0.9],
// written in powers of y in [-1, 1]. Relative error 3.4e-8. Even and odd powers apart, so that the two chains
// run side by side.
double BroadKappa(double r, double delta) {
  constexpr std::array<double, 15> c = {
      2.5062672702,      -0.484192756867,   0.0385427264154,    0.0450925177299,   0.0198309455664,
      0.000958752855165, -0.00709582216195, -0.00840198738484,  -0.0065132782388,  -0.000601889798943,
      0.00537534163641,  0.00411570927474,  -0.000533533636453, -0.00144916773877, -0.000352454570396};
  const double y = r * r * (2 / 0.8101) - 1;
  const double y2 = y * y;
  double even = c[14], odd = c[13];
  for (int i = 12; i >= 2; i -= 2) {
    even = even * y2 + c[i];
    odd = odd * y2 + c[i - 1];
  }
  even = even * y2 + c[0];
  return r * (even + y * odd) / (delta * (2 - delta));
}

// kappa of the lobe whose mean cosine is r = 1 - delta; each caller knows one of the two to more digits.
float KappaFrom(double r, double delta) {
  if (!(delta < 1)) return 0;
  if (delta >= kSharpDelta) return static_cast<float>(BroadKappa(r, delta));
  return delta > 1.0 / kMaxKappa ? static_cast<float>(1 / delta) : kMaxKappa;
}

// kappa / (2 pi (1 - e^(-2 kappa))).
double Normalization(double kappa) {
  if (kappa > 20) return kappa / kTwoPi;
  return kappa < 1e-9 ? 1 / (2 * kTwoPi) : kappa / (-kTwoPi * std::expm1(-2 * kappa));
}

// |a - b|^2 of unit vectors. 1 - a.b taken as half of this keeps its digits for close directions, where the
// float dot product has none left; errors of the vectors' lengths enter only squared.
double ChordSquared(const glm::vec3& a, const glm::vec3& b) {
  const double x = double{a.x} - b.x, y = double{a.y} - b.y, z = double{a.z} - b.z;
  return x * x + y * y + z * z;
}

// The product of two lobes is a lobe again, times a factor: kappa of that lobe, and how far it falls short of
// the sum.
struct ProductLobe {
  double kappa;      // ||kappa0 mu0 + kappa1 mu1||
  double shortfall;  // kappa0 + kappa1 - kappa, without cancellation
};

ProductLobe MultiplyLobes(const Vmf& l0, const Vmf& l1) {
  const double k0 = l0.kappa, k1 = l1.kappa;
  // |mu0 - mu1|^2 and |mu0 + mu1|^2 sum to 4: the smaller is measured, the other follows.
  const bool opposed = glm::dot(l0.mu, l1.mu) < 0;
  const double chord2 = ChordSquared(l0.mu, opposed ? -l1.mu : l1.mu);
  const double apart2 = opposed ? 4 - chord2 : chord2, along2 = opposed ? chord2 : 4 - chord2;
  const double difference = k0 - k1;
  const double kappa = std::sqrt(difference * difference + k0 * k1 * along2);
  const double sum = k0 + k1 + kappa;
  return {kappa, sum > 0 ? k0 * k1 * apart2 / sum : 0};
}

// log of (gamma0 . gamma1) / (||gamma0|| ||gamma1||) <= 0; exact to first order where the lobes nearly agree,
// so that the distance of close lobes is no difference of large numbers.
double LogCorrelation(const Vmf& l0, const Vmf& l1, const ProductLobe& product) {
  const double k0 = l0.kappa, k1 = l1.kappa;
  if (std::min({product.kappa, 2 * k0, 2 * k1}) < 1) {
    const double n = std::log(Normalization(product.kappa));
    return 0.5 * (std::log(Normalization(2 * k0)) + std::log(Normalization(2 * k1))) - n - product.shortfall;
  }
  const double difference = k0 - k1;
  const double excess = k0 * k1 * ChordSquared(l0.mu, l1.mu) - difference * difference;  // 4 k0 k1 - kappa^2
  const double ratio = std::log1p(excess / (product.kappa * product.kappa));
  const double tails = std::log(-std::expm1(-4 * k0)) + std::log(-std::expm1(-4 * k1));
  return 0.5 * (ratio - tails) + std::log(-std::expm1(-2 * product.kappa)) - product.shortfall;
}

}  // namespace

float DeltaFromKappa(float kappa) { return static_cast<float>(Delta(kappa)); }

float KappaFromDelta(float delta) { return KappaFrom(1 - double{delta}, delta); }

float MeanCosineFromKappa(float kappa) {
  return static_cast<float>(kappa < kSeriesKappa ? MeanCosineSeries(kappa) : 1 - Delta(kappa));
}

float KappaFromMeanCosine(float r) { return r > 0 ? KappaFrom(r, 1 - double{r}) : 0; }

float VmfNormalization(float kappa) { return static_cast<float>(Normalization(kappa)); }

float VmfPdf(const Vmf& lobe, const glm::vec3& s) {
  const glm::vec3 chord = lobe.mu - s;
  return VmfNormalization(lobe.kappa) * std::exp(-0.5f * lobe.kappa * glm::dot(chord, chord));
}

glm::vec3 SampleVmf(const Vmf& lobe, float u, float v) {
  // 1 - cos theta = -log(u + (1 - u) e^(-2 kappa)) / kappa; near 1 the logarithm's argument keeps its digits
  // as 1 + (1 - u) (e^(-2 kappa) - 1) only, near 0 as it stands only.
  const float tail = std::expm1(-2 * lobe.kappa);
  const float a = (1 - u) * tail;
  const float log_u = a > -0.5f ? std::log1p(a) : std::log(u + (1 - u) * (1 + tail));
  const float one_minus_cos = lobe.kappa > 1e-30f ? std::clamp(-log_u / lobe.kappa, 0.0f, 2.0f) : 2 * (1 - u);
  const float sin_theta = std::sqrt(one_minus_cos * (2 - one_minus_cos));
  const float phi = static_cast<float>(kTwoPi) * v;
  const glm::vec3 local{sin_theta * std::cos(phi), sin_theta * std::sin(phi), 1 - one_minus_cos};
  return glm::normalize(Frame::FromNormal(lobe.mu).ToWorld(local));
}

float VmfInnerProduct(const Vmf& l0, const Vmf& l1) {
  const ProductLobe product = MultiplyLobes(l0, l1);
  return static_cast<float>(Normalization(l0.kappa) * Normalization(l1.kappa) / Normalization(product.kappa) *
                            std::exp(-product.shortfall));
}

float VmfDistance2(float w0, const Vmf& l0, float w1, const Vmf& l1) {
  // (w0 |g0| - w1 |g1|)^2 + 2 w0 w1 (|g0| |g1| - g0.g1): no term is a difference of nearly equal products.
  const double norm0 = Normalization(l0.kappa) / std::sqrt(Normalization(2 * double{l0.kappa}));
  const double norm1 = Normalization(l1.kappa) / std::sqrt(Normalization(2 * double{l1.kappa}));
  const double difference = w0 * norm0 - w1 * norm1;
  const double angle = -std::expm1(std::min(0.0, LogCorrelation(l0, l1, MultiplyLobes(l0, l1))));
  return static_cast<float>(std::max(0.0, difference * difference + 2.0 * w0 * w1 * norm0 * norm1 * angle));
}

void VmfMoments::Add(double w, const Vmf& lobe) {
  weight += w;
  AddVector(w * (1 - Delta(lobe.kappa)), lobe.mu);
}

VmfMoments& VmfMoments::operator+=(const VmfMoments& o) {
  weight += o.weight;
  x += o.x;
  y += o.y;
  z += o.z;
  return *this;
}

namespace {

Vmf LobeFromMeanVector(double x, double y, double z) {
  const double r = std::sqrt(x * x + y * y + z * z);
  if (!(r > kNoDirection)) return {};
  return {{static_cast<float>(x / r), static_cast<float>(y / r), static_cast<float>(z / r)},
          KappaFrom(r, 1 - r)};
}

}  // namespace

Vmf VmfMoments::Lobe() const {
  return weight > 0 ? LobeFromMeanVector(x / weight, y / weight, z / weight) : Vmf{};
}

Vmf LobeFromMean(const glm::vec3& m) { return LobeFromMeanVector(m.x, m.y, m.z); }

}  // namespace glint
