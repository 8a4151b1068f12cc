#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <vector>

#include "common/render/environment.h"
#include "common/render/float4.h"

namespace glint {

/// Light as point masses on a latitude-longitude grid (nodes at texel centres), ready to be convolved: the
/// environment's bilinear radiance, its energy and first moments kept, smeared a little. How much it is
/// smeared is known, and the convolution takes it off its own width.
class SphereMasses {
 public:
  /// Every texel of the environment a node. An environment coarser than a minimal grid is resampled to that
  /// first.
  static SphereMasses FromEnvironment(const Environment& environment);
  /// Masses of `fine` spread over width x height nodes (width even) by quadratic B-splines, which keep the
  /// second moment of every mass up to a constant: spacing^2 / 4.
  static SphereMasses Coarsened(const SphereMasses& fine, int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  double spacing() const { return 3.14159265358979323846 / height_; }  ///< rad, along a meridian
  /// Sum of all masses over the sum of their solid angles.
  glm::vec3 Mean() const;

 private:
  friend class SphereConvolution;

  int width_ = 0, height_ = 0;
  std::vector<float> mass_[3];       ///< per channel, height x width: radiance x solid angle
  std::vector<double> solid_angle_;  ///< per row: of one node, sr
  /// Smear of the masses beyond that of the bilinear environment, rad^2 (negative: less than it); along
  /// longitude it is meant at the equator and shrinks with the square of the cosine.
  double excess_latitude_ = 0, excess_longitude_ = 0;
};

/// The masses convolved with a vMF lobe, on the same nodes, readable in between.
class SphereConvolution {
 public:
  /// `kappa` > 0. Sums directly over the nodes where the lobe is above e^-12 of its peak. The same for any
  /// `threads`.
  SphereConvolution(const SphereMasses& masses, double kappa, int threads);

  /// Value at texture position (u, v) in [0, 1]^2 (Environment::Coordinates) by Lagrange's polynomial over 6
  /// x 6 nodes.
  glm::vec3 At(float u, float v) const;

 private:
  static constexpr int kPad = 3;

  void ConvolveRow(const SphereMasses& masses, double kappa, const std::vector<float>* extended, int row);
  void WrapPadding();
  glm::vec4& node(int x, int y) { return nodes_[size_t(y + kPad) * (width_ + 2 * kPad) + x + kPad]; }

  int width_, height_;
  std::vector<glm::vec4> nodes_;  ///< (height + 2 kPad) x (width + 2 kPad), padded across poles and the seam
};

}  // namespace glint
