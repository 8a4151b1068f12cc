#include "worker/angular_refinement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <numeric>

#include "common/archive/lobe_codec.h"
#include "common/archive/nested.h"

namespace glint {
namespace {

constexpr int kToleranceLevel = 3;  ///< that the tolerance is of

}  // namespace

AngularRefinement::AngularRefinement(const DirectionGrid& grid, const SlotLayout& layout, bool direct,
                                     float tolerance)
    : grid_(grid),
      layout_(layout),
      direct_(direct),
      entry_bytes_(direct ? kDirectEntryBytes : kIndirectEntryBytes),
      tolerance2_(tolerance * tolerance),
      entry_(layout.count() * size_t{grid.size()}, kNoEntry),
      state_(layout.specular * size_t{grid.size()}, kUnknown),
      value_(state_.size()),
      activated_(grid.size(), 0) {
  computed_.slots.resize(layout.count());
}

void AngularRefinement::Begin() {
  for (const uint32_t direction : directions_)
    for (uint32_t slot = 0; slot < layout_.count(); ++slot) entry_[at(direction, slot)] = kNoEntry;
  for (const uint32_t direction : known_)
    for (uint32_t slot = 0; slot < layout_.specular; ++slot) state_[at(direction, slot)] = kUnknown;
  directions_.clear();
  known_.clear();
  for (BlockRows& rows : computed_.slots) {
    rows.columns.clear();
    rows.entries.clear();
    rows.counts.assign(1, 0);
  }
}

void AngularRefinement::Refine(const RefinedSide& side) {
  const uint32_t base = DirectionGrid::SizeOf(grid_.base_level());
  for (uint32_t direction = 0; direction < base; ++direction)
    if (Above(side, direction)) Compute(side, direction);
  const int everywhere = std::max(side.everywhere, grid_.base_level() + 1);
  next_.clear();
  for (int level = grid_.base_level() + 1; level <= grid_.level(); ++level) {
    if (level <= everywhere) {
      active_.resize(DirectionGrid::SizeOf(level) - DirectionGrid::SizeOf(level - 1));
      std::iota(active_.begin(), active_.end(), DirectionGrid::SizeOf(level - 1));
    } else {
      std::swap(active_, next_);
    }
    next_.clear();
    for (const uint32_t direction : active_) {
      activated_[direction] = 0;
      if (!Above(side, direction)) continue;
      Compute(side, direction);
      if (Misses(side, direction, level) && level < grid_.level() && level >= everywhere)
        Activate(direction, level);
    }
  }
}

bool AngularRefinement::Above(const RefinedSide& side, uint32_t direction) const {
  return glm::dot(side.normal, grid_.direction(direction)) > 0;
}

void AngularRefinement::Compute(const RefinedSide& side, uint32_t direction) {
  side.compute(direction, &computed_);
  directions_.push_back(direction);
  known_.push_back(direction);
  for (uint32_t slot = 0; slot < layout_.count(); ++slot) {
    const std::vector<uint16_t>& columns = computed_.slots[slot].columns;
    if (!columns.empty() && columns.back() == direction)
      entry_[at(direction, slot)] = static_cast<int32_t>(columns.size()) - 1;
  }
  for (uint32_t slot = 0; slot < static_cast<uint32_t>(side.lobes); ++slot) {
    state_[at(direction, slot)] = kStored;
    value_[at(direction, slot)] = Measure(direction, slot, side.kappa);
  }
}

EntryLight AngularRefinement::Measure(uint32_t direction, uint32_t slot, float kappa) const {
  const std::byte* bytes = Entry(direction, slot);
  if (direct_ && !bytes) return LightOf(DirectLobe{});
  EntryLight sums;
  DirectWidth width;
  for (; bytes; bytes = slot < layout_.count() ? Entry(direction, slot) : nullptr) {
    if (direct_) {
      const DirectLobe lobe = DecodeDirect(bytes);
      sums.Add(LightOf(lobe));
      width.Add(lobe);
    } else {
      sums.Add(LightOf(DecodeIndirect(bytes)));
    }
    slot += layout_.stride();
  }
  if (width.lobes() > 1) sums.alpha.z = width.Light(kappa);
  return sums;
}

/// What is read at a direction, computed or not.
const EntryLight& AngularRefinement::Value(const RefinedSide& side, uint32_t direction, uint32_t slot) {
  EntryLight& value = value_[at(direction, slot)];
  if (state_[at(direction, slot)] != kUnknown) return value;
  known_.push_back(direction);
  state_[at(direction, slot)] = kPredicted;
  const bool base = direction < DirectionGrid::SizeOf(grid_.base_level());  // under the horizon
  return value = base ? Measure(direction, slot, side.kappa) : Predict(side, direction, slot);
}

EntryLight AngularRefinement::Predict(const RefinedSide& side, uint32_t direction, uint32_t slot) {
  const std::array<uint32_t, 2>& ends = grid_.midpoint(direction).ends;
  const auto share = ShareOfEnds(ends, [&](uint32_t d) { return Above(side, d); });
  EntryLight sums;
  for (int e = 0; e < 2; ++e) {
    if (share[e] <= 0) continue;
    sums.Add(Value(side, ends[e], slot), share[e]);
  }
  return sums;
}

/// Whether some slot's slice is not as predicted. Those that are give way to their predictions.
bool AngularRefinement::Misses(const RefinedSide& side, uint32_t direction, int level) {
  const float tolerance2 = std::ldexp(tolerance2_, 2 * (level - kToleranceLevel));
  const float seen = side.kappa * kJudgedLightKappa / (side.kappa + kJudgedLightKappa);
  bool misses = false;
  for (uint32_t slot = 0; slot < static_cast<uint32_t>(side.lobes); ++slot) {
    EntryLight& value = value_[at(direction, slot)];
    const EntryLight predicted = Predict(side, direction, slot);
    if (Distance2(predicted, value, seen) > tolerance2) {
      misses = true;
    } else {
      state_[at(direction, slot)] = kPredicted;
      value = predicted;
    }
  }
  return misses;
}

/// The level's triangles around a direction that it adds: their edges' midpoints are next.
void AngularRefinement::Activate(uint32_t direction, int level) {
  const DirectionGrid::Midpoint& midpoint = grid_.midpoint(direction);
  for (int side = 0; side < 2; ++side) {
    const uint32_t edge = midpoint.edge[side];
    for (const uint32_t child : {edge, (edge + 1) % 3, 3u}) {
      const size_t triangle = 4 * size_t{midpoint.triangle[side]} + child;
      for (const uint32_t next : grid_.triangles(level + 1)[4 * triangle + 3]) {
        if (activated_[next]) continue;
        activated_[next] = 1;
        next_.push_back(next);
      }
    }
  }
}

const std::byte* AngularRefinement::Entry(uint32_t direction, uint32_t slot) const {
  const int32_t entry = entry_[at(direction, slot)];
  return entry < 0 ? nullptr
                   : computed_.slots[slot].entries.data() + static_cast<size_t>(entry) * entry_bytes_;
}

uint64_t AngularRefinement::Store(const GatherBlock& block, BlockResult* out) {
  std::sort(directions_.begin(), directions_.end());
  const auto begin = std::lower_bound(directions_.begin(), directions_.end(), block.first_column);
  const auto end = std::lower_bound(begin, directions_.end(), block.first_column + block.columns);
  for (uint32_t slot = 0; slot < layout_.specular; ++slot)
    for (auto direction = begin; direction != end; ++direction)
      if (state_[at(*direction, slot)] == kStored) StoreSlice(*direction, slot, out);
  return static_cast<uint64_t>(end - begin);
}

/// Beyond the base level a free, or dark, slice has to be said to be one.
void AngularRefinement::StoreSlice(uint32_t direction, uint32_t slot, BlockResult* out) const {
  const auto column = static_cast<uint16_t>(direction);
  if (!Entry(direction, slot) && direction >= DirectionGrid::SizeOf(grid_.base_level())) {
    std::byte* bytes = out->slots[slot].AddEntry(column, entry_bytes_);
    direct_ ? EncodeDirect({}, bytes) : EncodeIndirect({}, bytes);
  }
  for (; slot < layout_.count(); slot += layout_.stride()) {
    const std::byte* bytes = Entry(direction, slot);
    if (!bytes) return;
    std::memcpy(out->slots[slot].AddEntry(column, entry_bytes_), bytes, entry_bytes_);
  }
}

}  // namespace glint
