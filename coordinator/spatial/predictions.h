#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/domain/bake_domain.h"
#include "coordinator/spatial/vertex_hierarchy.h"

namespace glint {

/// Which nodes are baked, and from which of these every other is predicted.
class Predictions {
 public:
  void Resize(size_t nodes) { lists_.resize(nodes), dark_.resize(nodes, 0); }

  /// @param dark  nothing reaches the node, as inside another object: it has no say where others have one
  void Bake(uint32_t node, bool dark);
  void Predict(uint32_t node, std::span<const Parent> parents) { lists_[node] = Combine(parents); }
  /// The prediction from these: at most kMaxNodeRows baked nodes, heaviest first, weights add up to 1. None
  /// if no parent has any.
  std::vector<Parent> Combine(std::span<const Parent> parents) const;
  std::span<const Parent> Of(uint32_t node) const { return lists_[node]; }
  size_t nodes() const { return lists_.size(); }
  size_t baked() const { return baked_; }

  /// What is baked in the end, for a domain's nodes with their splits. Every node that is the same as another
  /// one takes its prediction; dark nodes beside others take theirs, so that no darkness reaches out from
  /// where nobody looks; rows that nobody asks for are left out.
  /// @param same_as  of each node: the first that is the same
  BakeNodes Finish(const BakeDomain& domain, std::span<const uint32_t> same_as) const;

 private:
  std::vector<std::vector<Parent>> LightUpBorders(const BakeDomain& domain,
                                                  std::span<const uint32_t> same_as) const;

  std::vector<std::vector<Parent>> lists_;  ///< of each node, in baked nodes
  std::vector<uint8_t> dark_;
  size_t baked_ = 0;
};

}  // namespace glint
