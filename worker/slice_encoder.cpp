#include "worker/slice_encoder.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/base/frame.h"
#include "common/lobes/vmf.h"

namespace glint {

Vmf LobeOf(const glm::dvec3& m, double weight, const SliceLobe& lobe) {
  const double length = glm::length(m);
  if (length <= 1e-12 * weight) return {lobe.mu, 0};
  const double sharpest = 1.0 / (16.0 * std::max(lobe.resolved_kappa(), 0.0625f));
  const double delta = std::clamp(1 - length / weight, std::min(sharpest, 1.0), 1.0);
  return {glm::vec3(m / length), KappaFromDelta(static_cast<float>(delta))};
}

void BlockedRays::Add(const glm::vec3& direction, bool is_blocked) {
  all += 1;
  all_sum += glm::dvec3(direction);
  if (!is_blocked) return;
  blocked += 1;
  blocked_sum += glm::dvec3(direction);
}

DirectMoments BlockedRays::Moments(const SliceLobe& lobe) const {
  if (all == 0) return {.visible = 0};
  if (blocked == 0) return {};
  const double h = blocked / all, r = 1 - static_cast<double>(DeltaFromKappa(lobe.kappa));
  return {1 - h, (1 - h) * r * glm::dvec3(lobe.mu) + h * (all_sum / all - blocked_sum / blocked)};
}

DirectLobe DirectLobeOf(const SliceLobe& lobe, const DirectMoments& moments) {
  const Vmf mean = LobeOf(moments.mean, moments.visible, lobe);
  // What the coarser gathering lobe lost on its edge is narrower in proportion on the real one.
  const float narrowing = std::sqrt(lobe.resolution);
  DirectLobe direct;
  direct.fraction = static_cast<float>(moments.visible);
  direct.shift = glm::clamp((mean.mu - lobe.mu) * narrowing, glm::vec3(-2), glm::vec3(2));
  direct.kappa_ratio = std::clamp(mean.kappa / std::max(lobe.resolved_kappa(), 1e-6f), 0x1p-20f, 0x1p20f);
  return direct;
}

std::optional<DirectLobe> FitDirect(const SliceLobe& lobe, const DirectMoments& moments, float drop) {
  if (moments.visible >= 1 - drop) return std::nullopt;
  if (moments.visible <= drop) return DirectLobe{.fraction = 0};
  return DirectLobeOf(lobe, moments);
}

IndirectLobe IndirectLobeOf(const SliceLobe& lobe, const IndirectMoments& moments) {
  const glm::vec3 alpha(moments.alpha);
  const Vmf mean = LobeOf(moments.moment, Luminance(alpha), lobe);
  return {glm::max(alpha, glm::vec3(0)), mean.mu, mean.kappa};
}

std::optional<IndirectLobe> FitIndirect(const SliceLobe& lobe, const IndirectMoments& moments, float drop) {
  if (std::max({moments.alpha.x, moments.alpha.y, moments.alpha.z}) < drop) return std::nullopt;
  return IndirectLobeOf(lobe, moments);
}

void StoreDirect(const std::optional<DirectLobe>& lobe, uint16_t column, BlockRows* rows) {
  if (lobe) EncodeDirect(*lobe, rows->AddEntry(column, kDirectEntryBytes));
}

void StoreIndirect(const std::optional<IndirectLobe>& lobe, uint16_t column, BlockRows* rows) {
  if (lobe) EncodeIndirect(*lobe, rows->AddEntry(column, kIndirectEntryBytes));
}

}  // namespace glint
