#include "coordinator/spatial/lobe_sight.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace glint {
namespace {

constexpr float kDim2 = 0.01f;  ///< square of the radiance below which errors count as absolute

/// Lights of a LobeSky: so many of each kind, of such a part of the sky's light and such a kappa.
struct Lights {
  float count, part, kappa;
};
constexpr Lights kLights[] = {{3, 0.1f, 16}, {2, 0.1f, 256}};

glm::vec3 UnitOrZero(const glm::vec3& v) {
  const float length = glm::length(v);
  return length > 1e-6f ? v / length : glm::vec3(0);
}

float Chord2(const glm::vec3& a, const glm::vec3& b) { return glm::dot(a - b, a - b); }

}  // namespace

void SightBlend::Add(float weight, const LobeSight& sight) {
  weight_ += weight;
  open_ += weight * sight.open;
  if (sight.light > 0) lobe_[lobes_++] = {weight * sight.light, UnitOrZero(sight.onward)};
}

glm::vec3 SightBlend::Onward() const {
  glm::vec3 sum(0);
  for (int i = 0; i < lobes_; ++i) sum += lobe_[i].light * lobe_[i].mu;
  return UnitOrZero(sum);
}

void SightBlend::Join(float chord2) {
  open_ /= weight_;
  for (int i = 0; i < lobes_; ++i) lobe_[i].light /= weight_;
  weight_ = 1;
  if (lobes_ < 2) return;
  const glm::vec3 strongest =
      std::max_element(lobe_.begin(), lobe_.begin() + lobes_, [](const Lobe& a, const Lobe& b) {
        return a.light < b.light;
      })->mu;
  Lobe joint{0, glm::vec3(0)};
  int left = 0;
  for (int i = 0; i < lobes_; ++i) {
    if (Chord2(lobe_[i].mu, strongest) <= chord2) {
      joint.light += lobe_[i].light;
      joint.mu += lobe_[i].light * lobe_[i].mu;
    } else {
      lobe_[left++] = lobe_[i];
    }
  }
  joint.mu = UnitOrZero(joint.mu);
  lobe_[left] = joint;
  lobes_ = left + 1;
}

SightError::SightError(float kappa) : covariance_(kSteps + 1, 0) {
  const float twice = 0.5f * kappa;  // of a lobe that is reflected twice
  alike2_ = 4 / twice;
  // Lights of part P from the upper half have P^2 (4 pi)^2 / (2 pi) times the lobe of lobes convolved.
  for (const Lights& lights : kLights) {
    const float both = 1 / (2 / lights.kappa + 2 / twice);
    for (int i = 0; i <= kSteps; ++i) {
      const float chord2 = 4 * static_cast<float>(i) / kSteps;
      covariance_[i] += lights.count * 4 * lights.part * lights.part * both * std::exp(-0.5f * both * chord2);
    }
  }
}

float SightError::Covariance(const glm::vec3& a, const glm::vec3& b) const {
  return covariance_[static_cast<size_t>(std::min(Chord2(a, b) * (0.25f * kSteps) + 0.5f, 1.0f * kSteps))];
}

double SightError::operator()(const LobeSight& own, SightBlend predicted) const {
  predicted.Join(alike2_);
  // Free lobes lie where the node's own does: what is stored is relative to it.
  const float variance = covariance_[0], free = own.open - predicted.open_;
  std::array<SightBlend::Lobe, kMaxNodeRows + 1> lobe;
  int lobes = 0;
  float sum = free, answer = predicted.open_;
  if (own.light > 0) lobe[lobes++] = {own.light, UnitOrZero(own.onward)};
  for (int i = 0; i < predicted.lobes_; ++i) {
    lobe[lobes++] = {-predicted.lobe_[i].light, predicted.lobe_[i].mu};
    answer += predicted.lobe_[i].light;
  }
  float square = variance * free * free;
  for (int i = 0; i < lobes; ++i) {
    sum += lobe[i].light;
    square += variance * lobe[i].light * lobe[i].light;
    for (int j = 0; j < i; ++j)
      square += 2 * lobe[i].light * lobe[j].light * Covariance(lobe[i].mu, lobe[j].mu);
  }
  const float truth = own.open + own.light;
  const float norm = 0.5f * (1 + variance) * (answer * answer + truth * truth) + kDim2;
  return std::max(sum * sum + square, 0.0f) / norm;
}

}  // namespace glint
