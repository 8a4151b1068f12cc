#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <vector>

#include "common/domain/bake_nodes.h"

namespace glint {

/// What a BRDF lobe sees, as far as it takes to foretell how wrong a prediction of its slice is.
struct LobeSight {
  float open = 0;       ///< part of it that nothing blocks
  float light = 0;      ///< reflectance of the surfaces that it sees, times their part
  glm::vec3 onward{0};  ///< mean direction that they reflect it to as mirrors, times light
};

/// Sights of a few nodes interpolated, as look-ups do it with slices (common/archive/blend.h).
class SightBlend {
 public:
  /// At most kMaxNodeRows; weights need not add up to 1.
  void Add(float weight, const LobeSight& sight);
  bool empty() const { return weight_ <= 0; }
  /// Of the weights: all see nothing but the outside.
  bool free() const { return open_ == weight_; }
  /// Mean direction of light that is reflected onward; zero if none is.
  glm::vec3 Onward() const;

 private:
  friend class SightError;
  struct Lobe {
    float light;
    glm::vec3 mu;
  };
  /// Weights add up to 1, and lobes within a chord of the strongest are one.
  void Join(float chord2);

  float weight_ = 0, open_ = 0;
  std::array<Lobe, kMaxNodeRows> lobe_;
  int lobes_ = 0;
};

/// The error that a prediction of a lobe's slice causes under skies like those of LobeSky, in closed form. Of
/// each lobe, free ones and those that surfaces reflect onward, the sky's light is a random number with mean
/// 1; numbers of two lobes are the more alike the less they are apart.
class SightError {
 public:
  /// @param kappa  of the BRDF's lobe, and of what it sees
  explicit SightError(float kappa);

  /// Mean square of the difference of radiance, relative to the mean square of both.
  double operator()(const LobeSight& own, SightBlend predicted) const;

 private:
  static constexpr int kSteps = 256;
  float Covariance(const glm::vec3& a, const glm::vec3& b) const;

  float alike2_;                   ///< square of the chord up to which look-ups average lobes
  std::vector<float> covariance_;  ///< of the light of two lobes, at kSteps + 1 squares of chords, 0 to 4
};

}  // namespace glint
