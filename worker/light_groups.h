#pragma once

#include <array>
#include <glm/ext/vector_double3.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "common/base/frame.h"
#include "common/domain/bake_settings.h"
#include "worker/gather_kernel.h"
#include "worker/slice_encoder.h"

namespace glint {

/// Light of some of a slice's samples; sums add up.
struct LightGroup {
  double strength = 0;   ///< luminance
  glm::dvec3 moment{0};  ///< sum of strength * ||r|| mu
  glm::dvec3 colour{0};  ///< RGB

  LightGroup& operator+=(const LightGroup& o);
  LightGroup& operator*=(double factor);
  IndirectMoments Moments() const { return {colour, moment}; }
};

/// A slice's light in at most kMaxLightGroups groups, none of them empty.
class LightGroups {
 public:
  int size() const { return count_; }
  const LightGroup& operator[](int i) const { return group_[i]; }
  LightGroup* begin() { return group_.data(); }
  LightGroup* end() { return group_.data() + count_; }
  const LightGroup* begin() const { return group_.data(); }
  const LightGroup* end() const { return group_.data() + count_; }
  void Add(const LightGroup& group) { group_[count_++] = group; }
  /// Group j joins group i < j.
  void Join(int i, int j);

 private:
  std::array<LightGroup, kMaxLightGroups> group_;
  int count_ = 0;
};

/// Light that comes as single samples: a list in the making.
class LightSamples {
 public:
  /// @param light   RGB
  /// @param moment  first moment of its luminance
  void Add(const glm::vec3& light, const glm::vec3& moment);
  /// Leaves none.
  void Clear() { count_ = 0, total_ = {}; }
  /// Padded to whole groups of lanes; valid until the next sample is added.
  LightList List();
  const LightGroup& total() const { return total_; }

 private:
  std::array<std::vector<float>, LightList::kChannels> channels_;
  int count_ = 0;
  LightGroup total_;
};

/// Whether a slice's light could be worth more than one lobe: whether splitting it would lose no less than
/// the tolerance (JoinLikeGroups) if all spread beyond what the unoccluded lobe gives to one point's light
/// lay between two lobes.
bool CanBeSplit(const IndirectMoments& moments, const SliceLobe& lobe, double tolerance);

/// Groups samples by the direction of their light: weighted k-means (Lloyd) on mean direction vectors,
/// started from the principal axes of their spread, so that it depends on nothing but the list. What has no
/// strength counts nowhere; samples that are all alike come as one group.
/// @param total          sum of the list
/// @param least_between  one group, too, where no two could have more than this part of the spread between
///                       them
LightGroups GroupLight(const GatherKernels& kernels, const LightList& list, const LightGroup& total,
                       double least_between);

/// Joins groups, each time the two that are least missed, while there are more than `most` of them or what is
/// lost is below the tolerance: the part of the two's common spread (1 - ||r||) that lies between them, times
/// the root of their strength. Leaves them in the order of strength.
void JoinLikeGroups(int most, double tolerance, LightGroups* groups);

/// The groups that an indirect slice is stored as, relative to the BRDF lobe: none if it is one lobe, else
/// two to read_out.slice_lobes of them.
/// @param all   sum of the slice's weights
/// @param list  returns the LightList of its light, not relative; called for what CanBeSplit only
template <class List>
LightGroups SplitLight(const GatherKernels& kernels, const IndirectMoments& moments, double all,
                       const SliceLobe& lobe, const ReadOut& read_out, const List& list) {
  LightGroups groups;
  if (read_out.slice_lobes < 2 || !CanBeSplit(moments, lobe, read_out.lobe_tolerance)) return groups;
  LightGroup total{Luminance(glm::vec3(moments.alpha)), moments.moment, moments.alpha};
  const double least_between = read_out.lobe_tolerance / std::sqrt(total.strength);
  groups = GroupLight(kernels, list(), total *= all, least_between);
  for (LightGroup& group : groups) group *= 1.0 / all;
  JoinLikeGroups(read_out.slice_lobes, read_out.lobe_tolerance, &groups);
  return groups;
}

}  // namespace glint
