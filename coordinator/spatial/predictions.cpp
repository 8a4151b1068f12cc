#include "coordinator/spatial/predictions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/scene/scene.h"

namespace glint {
namespace {

/// Whole numbers in proportion to the weights, which add up to 1: what rounding leaves goes to the heaviest.
std::vector<uint16_t> Quantize(std::span<const Parent> list) {
  std::vector<uint16_t> whole;
  uint32_t sum = 0;
  for (const Parent& p : list) {
    whole.push_back(static_cast<uint16_t>(p.weight * static_cast<float>(kWholeWeight)));
    sum += whole.back();
  }
  if (!whole.empty()) whole[0] = static_cast<uint16_t>(whole[0] + (kWholeWeight - sum));
  return whole;
}

template <class Visit>
void VisitFacets(const BakeDomain& domain, const Visit& visit) {
  const FacetTree& facets = domain.nodes.facets;
  if (facets.unsplit()) {
    for (const auto& t : domain.triangles) visit(t);
    return;
  }
  for (uint32_t part = 0; part < facets.parts(); ++part)
    if (facets.is_facet(part)) visit(facets.corners(part));
}

}  // namespace

void Predictions::Bake(uint32_t node, bool dark) {
  lists_[node] = {{node, 1}};
  dark_[node] = dark;
  ++baked_;
}

std::vector<Parent> Predictions::Combine(std::span<const Parent> parents) const {
  std::vector<Parent> all;
  bool any_light = false;
  for (const Parent& parent : parents)
    for (const Parent& baked : lists_[parent.node]) {
      const auto same =
          std::find_if(all.begin(), all.end(), [&](const Parent& p) { return p.node == baked.node; });
      const float weight = parent.weight * baked.weight;
      if (same == all.end()) {
        all.push_back({baked.node, weight});
      } else {
        same->weight += weight;
      }
      any_light = any_light || !dark_[baked.node];
    }
  if (any_light) std::erase_if(all, [&](const Parent& p) { return dark_[p.node] != 0; });
  std::sort(all.begin(), all.end(), [](const Parent& a, const Parent& b) {
    return std::pair(-a.weight, a.node) < std::pair(-b.weight, b.node);
  });
  if (all.size() > kMaxNodeRows) all.resize(kMaxNodeRows);
  float sum = 0;
  for (const Parent& p : all) sum += p.weight;
  for (Parent& p : all) p.weight /= sum;
  return all;
}

std::vector<std::vector<Parent>> Predictions::LightUpBorders(const BakeDomain& domain,
                                                             std::span<const uint32_t> same_as) const {
  auto is_dark = [&](uint32_t node) {
    const auto& list = lists_[same_as[node]];
    return !list.empty() && dark_[list[0].node];
  };
  std::vector<std::vector<Parent>> neighbours(lists_.size());
  VisitFacets(domain, [&](const std::array<uint32_t, 3>& corner) {
    for (const uint32_t a : corner)
      for (const uint32_t b : corner)
        if (is_dark(a) && !is_dark(b)) neighbours[same_as[a]].push_back({same_as[b], 1});
  });
  std::vector<std::vector<Parent>> lists = lists_;
  for (size_t node = 0; node < lists.size(); ++node)
    if (!neighbours[node].empty()) lists[node] = Combine(neighbours[node]);
  return lists;
}

BakeNodes Predictions::Finish(const BakeDomain& domain, std::span<const uint32_t> same_as) const {
  const std::vector<std::vector<Parent>> lists = LightUpBorders(domain, same_as);
  std::vector<uint32_t> row_of(lists.size(), kNone);
  for (const uint32_t node : same_as)
    for (const Parent& p : lists[node]) row_of[p.node] = 0;
  BakeNodes nodes = domain.nodes;
  nodes.rows.clear();
  nodes.weights.clear();
  nodes.first.assign(1, 0);
  for (uint32_t node = 0; node < row_of.size(); ++node) {
    if (row_of[node] == kNone) continue;
    row_of[node] = static_cast<uint32_t>(nodes.rows.size());
    nodes.rows.push_back(node);
  }
  for (const uint32_t node : same_as) {
    const std::vector<Parent>& list = lists[node];
    const std::vector<uint16_t> whole = Quantize(list);
    for (size_t i = 0; i < list.size(); ++i) nodes.weights.push_back({row_of[list[i].node], whole[i]});
    nodes.first.push_back(static_cast<uint32_t>(nodes.weights.size()));
  }
  return nodes;
}

}  // namespace glint
