#pragma once

#include <array>
#include <span>
#include <vector>

#include "common/lobes/brdf_table.h"

namespace glint {

/// One lobe of many slices, as arrays: direction in the frame of BrdfSlice, and concentration.
struct LobeArrays {
  std::vector<float> mu_x, mu_z, kappa;
};

/// A shape's slices tabulated for fast look-ups: linear between nodes in sqrt(cos_o), four to each interval
/// of the fit's own, with lobe directions kept relative to the mirror direction. Also tabulates what
/// AboveHorizon makes of each lobe. Against LookupSlice: directions within 1 % of a lobe's width (3 % at
/// cos_o < 0.001), kappa within 1 %, weights within 0.001.
class SliceSampler {
 public:
  explicit SliceSampler(const BrdfShape& shape);

  int lobes() const { return lobes_; }
  BrdfModel model() const { return model_; }
  float shape() const { return shape_; }
  /// Slice at cos_o in [0, 1] as fitted: what samples above the surface are weighed by.
  BrdfSlice Fitted(float cos_o) const { return Interpolate(cos_o, kFitted); }
  /// The same with its lobes as they are read out whole (AboveHorizon): what stored lobes are relative to.
  BrdfSlice Seen(float cos_o) const { return Interpolate(cos_o, kSeen); }
  /// Lobe k < lobes() of it.
  BrdfLobe SeenLobe(float cos_o, int k) const;
  /// Lobe k < lobes() of the slices at many cos_o in [0, 1], as fitted and as seen, several at a time.
  void Lobes(std::span<const float> cos_o, int k, LobeArrays* fitted, LobeArrays* seen) const;
  /// Scale and bias of every lobe's weight (BrdfLobe::Weight); the rest of the lobes is left as it is.
  void Weights(float cos_o, BrdfSlice* out) const;

 private:
  static constexpr int kIntervals = 4 * (kElevationNodes - 1);
  enum Form { kFitted = 0, kSeen = 1 };
  struct Node {
    float scale, bias, above;
    std::array<float, 2> along, across,
        kappa;  ///< [Form]; direction along the mirror's, across
  };
  struct Position {
    const Node* node;  ///< of lobe 0 below cos_o; lobe k of the next node is at [lobes + k]
    float t;
  };
  Position Find(float cos_o) const;
  BrdfSlice Interpolate(float cos_o, Form form) const;
  BrdfLobe InterpolateLobe(const Position& position, float c, float s, int k, Form form) const;

  BrdfModel model_;
  float shape_;
  int lobes_;
  std::vector<Node> nodes_;  ///< kIntervals + 1 times lobes
};

/// One of each shape, in order.
std::vector<SliceSampler> MakeSliceSamplers(const std::vector<BrdfShape>& shapes);

}  // namespace glint
