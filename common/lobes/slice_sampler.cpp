#include "common/lobes/slice_sampler.h"

#include <algorithm>
#include <cmath>

#include "common/lobes/horizon.h"

namespace glint {
namespace {

struct Direction {
  float x, z;
};

/// Unit, from parts along the mirror direction of wo = (s, c) and across it.
inline Direction Turn(float along, float across, float c, float s) {
  const float inverse = 1 / std::sqrt(along * along + across * across);
  return {(c * across - s * along) * inverse, (c * along + s * across) * inverse};
}

}  // namespace

// In the frame of BrdfSlice wo = (s, c) in (x, z), the mirror direction is (-s, c), and (c, s) is across it.
SliceSampler::SliceSampler(const BrdfShape& shape)
    : model_(shape.model), shape_(shape.shape), lobes_(shape.lobes) {
  nodes_.reserve(static_cast<size_t>(kIntervals + 1) * lobes_);
  for (int i = 0; i <= kIntervals; ++i) {
    const float t = static_cast<float>(i) / kIntervals;
    const float c = std::max(t * t, kMinCosine), s = std::sqrt((1 - c) * (1 + c));
    const BrdfSlice slice = LookupSlice(shape, c);
    for (int k = 0; k < lobes_; ++k) {
      const BrdfLobe &fitted = slice.lobe[k], seen = AboveHorizon(fitted);
      Node node{fitted.scale, fitted.bias, fitted.above, {}, {}, {fitted.kappa, seen.kappa}};
      node.along = {c * fitted.mu_z - s * fitted.mu_x, c * seen.mu_z - s * seen.mu_x};
      node.across = {c * fitted.mu_x + s * fitted.mu_z, c * seen.mu_x + s * seen.mu_z};
      nodes_.push_back(node);
    }
  }
}

SliceSampler::Position SliceSampler::Find(float cos_o) const {
  const float x = std::sqrt(cos_o) * kIntervals;
  const int node = std::min(static_cast<int>(x), kIntervals - 1);
  return {nodes_.data() + static_cast<ptrdiff_t>(node) * lobes_, x - static_cast<float>(node)};
}

BrdfLobe SliceSampler::InterpolateLobe(const Position& position, float c, float s, int k, Form form) const {
  const Node &a = position.node[k], &b = position.node[lobes_ + k];
  const float t = position.t;
  const float along = a.along[form] + t * (b.along[form] - a.along[form]);
  const float across = a.across[form] + t * (b.across[form] - a.across[form]);
  const Direction mu = Turn(along, across, c, s);
  BrdfLobe lobe;
  lobe.mu_x = mu.x;
  lobe.mu_z = mu.z;
  lobe.kappa = a.kappa[form] + t * (b.kappa[form] - a.kappa[form]);
  lobe.scale = a.scale + t * (b.scale - a.scale);
  lobe.bias = a.bias + t * (b.bias - a.bias);
  lobe.above = a.above + t * (b.above - a.above);
  return lobe;
}

BrdfSlice SliceSampler::Interpolate(float cos_o, Form form) const {
  const float c = std::clamp(cos_o, kMinCosine, 1.0f), s = std::sqrt((1 - c) * (1 + c));
  const Position position = Find(c);
  BrdfSlice out;
  out.lobes = lobes_;
  for (int k = 0; k < lobes_; ++k) out.lobe[k] = InterpolateLobe(position, c, s, k, form);
  return out;
}

BrdfLobe SliceSampler::SeenLobe(float cos_o, int k) const {
  const float c = std::clamp(cos_o, kMinCosine, 1.0f), s = std::sqrt((1 - c) * (1 + c));
  return InterpolateLobe(Find(c), c, s, k, kSeen);
}

// First what is looked up, then what takes roots and divisions: the latter loop runs in vector registers.
void SliceSampler::Lobes(std::span<const float> cos_o, int k, LobeArrays* fitted, LobeArrays* seen) const {
  LobeArrays* const out[2] = {fitted, seen};
  for (LobeArrays* lobes : out)
    for (auto* a : {&lobes->mu_x, &lobes->mu_z, &lobes->kappa}) a->resize(cos_o.size());
  for (size_t i = 0; i < cos_o.size(); ++i) {
    const auto [node, t] = Find(std::clamp(cos_o[i], kMinCosine, 1.0f));
    const Node &a = node[k], &b = node[lobes_ + k];
    for (const Form form : {kFitted, kSeen}) {
      out[form]->mu_z[i] = a.along[form] + t * (b.along[form] - a.along[form]);
      out[form]->mu_x[i] = a.across[form] + t * (b.across[form] - a.across[form]);
      out[form]->kappa[i] = a.kappa[form] + t * (b.kappa[form] - a.kappa[form]);
    }
  }
  for (LobeArrays* lobes : out) {
    const float* cosine = cos_o.data();
    float* const x = lobes->mu_x.data();
    float* const z = lobes->mu_z.data();
    for (size_t i = 0; i < cos_o.size(); ++i) {
      const float c = std::clamp(cosine[i], kMinCosine, 1.0f), s = std::sqrt((1 - c) * (1 + c));
      const Direction mu = Turn(z[i], x[i], c, s);
      x[i] = mu.x;
      z[i] = mu.z;
    }
  }
}

void SliceSampler::Weights(float cos_o, BrdfSlice* out) const {
  const auto [node, t] = Find(std::clamp(cos_o, kMinCosine, 1.0f));
  out->lobes = lobes_;
  for (int k = 0; k < lobes_; ++k) {
    const Node &a = node[k], &b = node[lobes_ + k];
    out->lobe[k].scale = a.scale + t * (b.scale - a.scale);
    out->lobe[k].bias = a.bias + t * (b.bias - a.bias);
  }
}

std::vector<SliceSampler> MakeSliceSamplers(const std::vector<BrdfShape>& shapes) {
  return {shapes.begin(), shapes.end()};
}

}  // namespace glint
