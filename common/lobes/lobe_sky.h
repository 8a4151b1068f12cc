#pragma once

#include <array>
#include <glm/vec3.hpp>

#include "common/base/rng.h"
#include "common/lobes/vmf.h"

namespace glint {

/// A sky made of lobes, drawn at random: what a lobe filters of it has a closed form, so that an archive's
/// answer under it costs no prefiltering and has no error of its own. Grey; its mean radiance is 1. Skies are
/// like photographed ones in what matters to a transport's error: a quarter of the light is the same from
/// everywhere, a quarter comes from the dome above, the rest from lights of all sizes between a window
/// (30 degrees wide) and a hazy sun (2 degrees), mostly above the horizon.
class LobeSky {
 public:
  explicit LobeSky(CounterRng* rng);

  float Radiance(const glm::vec3& d) const;
  /// integral of radiance x lobe.
  float Filtered(const Vmf& lobe) const;
  /// integral of radiance x max(0, n.s) / pi, within 1 % of a light's share.
  float CosineAverage(const glm::vec3& n) const;

 private:
  static constexpr int kLights = 6;  ///< the dome, three windows, two suns
  /// Legendre terms of the clamped cosine: orders 0, 1, 2, 4, 6, 8, 10; the odd ones above 1 vanish.
  static constexpr int kOrders = 7;

  struct Light {
    Vmf lobe;
    float power = 0;                      ///< integral of its radiance, sr
    float factor = 0;                     ///< radiance in the middle
    std::array<float, kOrders> cosine{};  ///< CosineAverage's terms in P(n.mu)
  };
  static Light MakeLight(const glm::vec3& mu, float kappa, float power);

  std::array<Light, kLights> light_;
};

}  // namespace glint
