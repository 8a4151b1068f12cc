#include "worker/aimed_lobes.h"

#include <algorithm>
#include <cmath>

namespace glint {
namespace {

constexpr float kLog2E = 1.44269504f;
constexpr float kCutoff = 6;  ///< a lobe ends where its exponent is -6: 2.5e-3 of its weight lies beyond
constexpr float kNormalIncidence = 1e-12f;  ///< square of a sine so small that every plane will do

}  // namespace

void AimedLobes::Aim(const DirectionGrid& grid, uint32_t first, uint32_t columns, const SliceSampler& sampler,
                     const Frame& frame, float max_kappa) {
  FindColumns(grid, first, columns, frame);
  lobes_.resize(static_cast<size_t>(sampler.lobes()));
  for (int k = 0; k < sampler.lobes(); ++k) {
    sampler.Lobes(cos_o_, k, &lobes_[k].fitted, &lobes_[k].seen);
    Bound(max_kappa, &lobes_[k]);
  }
}

void AimedLobes::FindColumns(const DirectionGrid& grid, uint32_t first, uint32_t columns,
                             const Frame& frame) {
  for (auto* a : {&plane_x_, &plane_y_, &cos_o_}) a->resize(columns);
  column_.resize(columns);
  size_t count = 0;
  for (uint32_t c = first; c < first + columns; ++c) {  // writes the next place until it is taken
    const glm::vec3 wo = frame.ToLocal(grid.direction(c));
    column_[count] = static_cast<uint16_t>(c);
    plane_x_[count] = wo.x;
    plane_y_[count] = wo.y;
    cos_o_[count] = wo.z;
    count += wo.z > 0;
  }
  column_.resize(count);
  for (auto* a : {&plane_x_, &plane_y_, &cos_o_}) a->resize(count);
  float *const x = plane_x_.data(), *const y = plane_y_.data();
  for (size_t i = 0; i < count; ++i) {
    const float sine2 = x[i] * x[i] + y[i] * y[i];
    const bool normal = sine2 < kNormalIncidence;
    const float inverse = 1 / std::sqrt(normal ? 1 : sine2);
    x[i] = normal ? 1 : x[i] * inverse;
    y[i] = y[i] * inverse;
  }
}

void AimedLobes::Bound(float max_kappa, Lobes* lobes) const {
  for (auto* a : {&lobes->kappa, &lobes->resolution, &lobes->cos_radius, &lobes->sin_radius})
    a->resize(size());
  const float* fitted = lobes->fitted.kappa.data();
  float *const kappa = lobes->kappa.data(), *const resolution = lobes->resolution.data();
  float *const cosine = lobes->cos_radius.data(), *const sine = lobes->sin_radius.data();
  for (size_t i = 0; i < size(); ++i) {
    kappa[i] = std::min(fitted[i], max_kappa);
    resolution[i] = std::min(kappa[i] / std::max(fitted[i], 1e-6f), 1.0f);
    cosine[i] = std::max(-1.0f, 1 - kCutoff / std::max(kappa[i], 1.0f));
    sine[i] = std::sqrt(1 - cosine[i] * cosine[i]);
  }
}

LobeWeight AimedLobes::weight(size_t i, int k) const {
  const glm::vec3 mu = Point(lobes_[k].fitted, i);
  return {mu.x, mu.y, mu.z, lobes_[k].kappa[i] * kLog2E};
}

QueryCone AimedLobes::cone(size_t i, int k) const {
  const glm::vec3 mu = Point(lobes_[k].fitted, i);
  return {mu.x, mu.y, mu.z, lobes_[k].cos_radius[i], lobes_[k].sin_radius[i]};
}

glm::vec3 AimedLobes::seen_mu(size_t i, int k) const { return Point(lobes_[k].seen, i); }

}  // namespace glint
