#pragma once

#include <array>
#include <glm/ext/vector_double3.hpp>

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

/// Whether a slice's light could be worth more than one lobe: there is enough of it, and it is spread wider
/// than the unoccluded lobe alone spreads what one point sends.
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

}  // namespace glint
