#pragma once

#include <array>
#include <glm/ext/vector_double3.hpp>
#include <glm/vec3.hpp>

#include "common/domain/bake_settings.h"
#include "worker/gather_kernel.h"
#include "worker/light_groups.h"
#include "worker/slice_encoder.h"

namespace glint {

/// What blockers leave of a lobe, in parts that add up to it, the strongest first. None: one lobe tells it.
struct VisibleParts {
  int count = 0;
  std::array<DirectMoments, kMaxLightGroups> part;
};

/// Samples of what is visible of a lobe, as white light: `total` is the sum over `list`, both in one frame.
struct VisibleLight {
  LightList list;
  LightGroup total;
};

/// Whether what is visible could be worth more than one lobe: neither it nor the rest is next to nothing.
bool CanBeCutUp(const DirectMoments& moments, const ReadOut& read_out);

/// Groups that are stored as lobes of their own; fewer than two: one lobe will do. At most
/// read_out.slice_lobes; as many as take out of the relit slice's error what they cost.
/// @param visible  part of the lobe that `light` is
LightGroups CutUp(const GatherKernels& kernels, const VisibleLight& light, double visible,
                  const SliceLobe& lobe, const ReadOut& read_out);

/// Groups as parts of a slice whose moments are known better than their sum.
/// @param to_world  to_world(v): of the groups' frame
template <class ToWorld>
VisibleParts PartsOf(const LightGroups& groups, const DirectMoments& moments, const ToWorld& to_world) {
  VisibleParts parts;
  LightGroup sum;
  for (const LightGroup& group : groups) sum += group;
  const double scale = moments.visible / sum.strength;
  const glm::dvec3 missing = (moments.mean - scale * to_world(sum.moment)) / moments.visible;
  for (const LightGroup& group : groups) {
    const double visible = scale * group.strength;
    parts.part[parts.count++] = {visible, scale * to_world(group.moment) + visible * missing};
  }
  return parts;
}

/// The parts that a direct slice is stored as.
/// @param see       returns the VisibleLight; called for what CanBeCutUp only
/// @param to_world  to_world(v): of its frame
template <class See, class ToWorld>
VisibleParts SplitDirect(const GatherKernels& kernels, const DirectMoments& moments, const SliceLobe& lobe,
                         const ReadOut& read_out, const See& see, const ToWorld& to_world) {
  if (!CanBeCutUp(moments, read_out)) return {};
  const LightGroups groups = CutUp(kernels, see(), moments.visible, lobe, read_out);
  return groups.size() < 2 ? VisibleParts{} : PartsOf(groups, moments, to_world);
}

}  // namespace glint
