#include "common/lobes/lobe_sky.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"

namespace glint {
namespace {

constexpr float kAmbient = 0.25f;
constexpr float kDome = 0.25f, kDomeKappa = 1;
constexpr int kWindows = 3, kSuns = 2;
constexpr float kWindowLight = 0.3f, kSunLight = 0.2f;  ///< of all windows, of all suns
constexpr float kWindowKappa[2] = {4, 64}, kSunKappa[2] = {64, 1024};
constexpr float kLowest = -0.1f;  ///< height of the lowest lights

/// Coefficients of max(0, x) in Legendre polynomials of orders 0, 1, 2, 4, 6, 8, 10.
constexpr std::array<double, 7> kCosineTerms = {1.0 / 4,    1.0 / 2,     5.0 / 16,   -3.0 / 32,
                                                13.0 / 256, -17.0 / 512, 49.0 / 2048};
constexpr int kHighestOrder = 10;

/// P_0 ... P_10 at x, by their recursion.
template <class T>
std::array<T, kHighestOrder + 1> Legendre(T x) {
  std::array<T, kHighestOrder + 1> p{1, x};
  for (int l = 1; l < kHighestOrder; ++l)
    p[l + 1] = (static_cast<T>(2 * l + 1) * x * p[l] - static_cast<T>(l) * p[l - 1]) / static_cast<T>(l + 1);
  return p;
}

/// Means of P_0 ... P_10 over a lobe, by the recursion of Bessel functions of half order. Upwards it loses
/// digits as kappa falls: in double 1e-6 are left at kappa = 1.
std::array<double, kHighestOrder + 1> LegendreMeans(double kappa) {
  std::array<double, kHighestOrder + 1> a{1, 1 / std::tanh(kappa) - 1 / kappa};
  for (int l = 1; l < kHighestOrder; ++l) a[l + 1] = a[l - 1] - (2 * l + 1) / kappa * a[l];
  return a;
}

constexpr int OrderOf(int term) { return term < 2 ? term : 2 * (term - 1); }

float LogUniform(const float (&range)[2], float u) { return range[0] * std::pow(range[1] / range[0], u); }

}  // namespace

LobeSky::Light LobeSky::MakeLight(const glm::vec3& mu, float kappa, float power) {
  Light light{{mu, kappa}, power, power * VmfNormalization(kappa), {}};
  const auto means = LegendreMeans(kappa);
  for (int i = 0; i < kOrders; ++i)
    light.cosine[i] = static_cast<float>(power * kCosineTerms[i] * means[OrderOf(i)] / kPi);
  return light;
}

LobeSky::LobeSky(CounterRng* rng) {
  static_assert(1 + kWindows + kSuns == kLights);
  constexpr float kSphere = 4 * kPi;
  light_[0] = MakeLight({0, 1, 0}, kDomeKappa, kSphere * kDome);
  for (int i = 1; i < kLights; ++i) {
    const float y = kLowest + (1 - kLowest) * rng->Uniform(), phi = 2 * kPi * rng->Uniform();
    const float r = std::sqrt(std::max(0.0f, 1 - y * y));
    const glm::vec3 mu = glm::normalize(glm::vec3(r * std::cos(phi), y, r * std::sin(phi)));
    const bool window = i <= kWindows;
    const float kappa = LogUniform(window ? kWindowKappa : kSunKappa, rng->Uniform());
    light_[i] = MakeLight(mu, kappa, kSphere * (window ? kWindowLight / kWindows : kSunLight / kSuns));
  }
}

float LobeSky::Radiance(const glm::vec3& d) const {
  float sum = kAmbient;
  for (const Light& light : light_) {
    const glm::vec3 chord = d - light.lobe.mu;
    sum += light.factor * std::exp(-0.5f * light.lobe.kappa * glm::dot(chord, chord));
  }
  return sum;
}

float LobeSky::Filtered(const Vmf& lobe) const {
  float sum = kAmbient;
  for (const Light& light : light_) sum += light.power * VmfInnerProduct(light.lobe, lobe);
  return sum;
}

float LobeSky::CosineAverage(const glm::vec3& n) const {
  float sum = kAmbient;
  for (const Light& light : light_) {
    const auto p = Legendre(glm::dot(n, light.lobe.mu));
    for (int i = 0; i < kOrders; ++i) sum += light.cosine[i] * p[OrderOf(i)];
  }
  return sum;
}

}  // namespace glint
