#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/archive/chunk.h"
#include "common/archive/entry_light.h"
#include "common/domain/direction_grid.h"

namespace glint {

/// What refinement asks of one side of a vertex.
struct RefinedSide {
  glm::vec3 normal;  ///< unit; directions above its horizon have slices
  int lobes = 0;     ///< specular lobes of the BRDF
  /// Level up to which every direction is computed, if that is beyond the one after the base level: the views
  /// of its directions leave no gaps.
  int everywhere = 0;
  float kappa = 0;  ///< of the sharpest lobe
  /// Appends a direction's slices, as they would be stored.
  std::function<void(uint32_t direction, BlockResult* out)> compute;
};

/// Chooses which of a vertex's slices a nested grid's table holds (laurijssen2009 section 4, but by parts of
/// the sphere). A slice is computed where the level is at most `everywhere`, or where one of the level
/// before, close by, was not as predicted. It is stored where its distance d from the prediction exceeds the
/// tolerance, which doubles with every level (at that of 642 directions it is as given): what a finer
/// direction corrects is a quarter of the area, so that of as many slices those are stored that take most out
/// of the mean square of the error.
/// d is Distance2's; light and moment are linear in the slices, so that half of those of the two ends is what
/// a reader that keeps lobes apart comes to as well. Slots are judged apart, and computed together.
class AngularRefinement {
 public:
  AngularRefinement(const DirectionGrid& grid, const SlotLayout& layout, bool direct, float tolerance);

  /// Turns to the next vertex.
  void Begin();
  void Refine(const RefinedSide& side);
  /// Appends the slices chosen, of both sides, in the block's columns; returns how many directions of the
  /// block were computed.
  uint64_t Store(const GatherBlock& block, BlockResult* out);

 private:
  enum State : uint8_t { kUnknown, kPredicted, kStored };
  static constexpr int32_t kNoEntry = -1;

  bool Above(const RefinedSide& side, uint32_t direction) const;
  void Compute(const RefinedSide& side, uint32_t direction);
  bool Misses(const RefinedSide& side, uint32_t direction, int level);
  EntryLight Measure(uint32_t direction, uint32_t slot, float kappa) const;
  const EntryLight& Value(const RefinedSide& side, uint32_t direction, uint32_t slot);
  EntryLight Predict(const RefinedSide& side, uint32_t direction, uint32_t slot);
  void Activate(uint32_t direction, int level);
  const std::byte* Entry(uint32_t direction, uint32_t slot) const;
  void StoreSlice(uint32_t direction, uint32_t slot, BlockResult* out) const;
  size_t at(uint32_t direction, uint32_t slot) const { return slot * size_t{grid_.size()} + direction; }

  const DirectionGrid& grid_;
  const SlotLayout layout_;
  const bool direct_;
  const uint32_t entry_bytes_;
  const float tolerance2_;

  BlockResult computed_;
  std::vector<int32_t> entry_;           ///< at(direction, slot): where it is in computed_
  std::vector<State> state_;             ///< the same, of specular slots
  std::vector<EntryLight> value_;        ///< the same: of what is read there; valid unless kUnknown
  std::vector<uint32_t> directions_;     ///< computed
  std::vector<uint32_t> known_;          ///< whose state is known
  std::vector<uint32_t> active_, next_;  ///< of a level, and of the one after it
  std::vector<uint8_t> activated_;
};

}  // namespace glint
