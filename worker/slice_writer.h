#pragma once

#include <cstdint>

#include "common/archive/chunk.h"
#include "common/domain/bake_settings.h"
#include "worker/gather_kernel.h"
#include "worker/light_groups.h"
#include "worker/slice_encoder.h"
#include "worker/visible_parts.h"

namespace glint {

/// Where a slice is stored: column of a row, and slot of its first lobe.
struct SlicePlace {
  uint16_t column;
  uint32_t slot;
};

/// Appends slices to a block's rows, each as the lobes that it is worth.
class SliceWriter {
 public:
  SliceWriter(const GatherKernels& kernels, const ReadOut& read_out, uint32_t stride)
      : kernels_(kernels), read_out_(read_out), stride_(stride) {}

  /// @param see       as SplitDirect's
  /// @param to_world  the same
  template <class See, class ToWorld>
  void Direct(const SliceLobe& lobe, const DirectMoments& moments, const SlicePlace& place, const See& see,
              const ToWorld& to_world, BlockResult* result) const {
    const VisibleParts parts = SplitDirect(kernels_, moments, lobe, read_out_, see, to_world);
    if (parts.count == 0)
      StoreDirect(FitDirect(lobe, moments, read_out_.drop), place.column, &result->slots[place.slot]);
    for (int g = 0; g < parts.count; ++g)
      StoreDirect(DirectLobeOf(lobe, parts.part[g]), place.column, RowsOf(place, g, result));
  }

  /// @param all    sum of the slice's weights
  /// @param light  as SplitLight's list
  template <class Light>
  void Indirect(const SliceLobe& lobe, const IndirectMoments& moments, double all, const SlicePlace& place,
                const Light& light, BlockResult* result) const {
    const LightGroups groups = SplitLight(kernels_, moments, all, lobe, read_out_, light);
    if (groups.size() < 2) {
      StoreIndirect(FitIndirect(lobe, moments, read_out_.drop), place.column, &result->slots[place.slot]);
      return;
    }
    for (int g = 0; g < groups.size(); ++g)
      StoreIndirect(IndirectLobeOf(lobe, groups[g].Moments()), place.column, RowsOf(place, g, result));
  }

 private:
  BlockRows* RowsOf(const SlicePlace& place, int lobe, BlockResult* result) const {
    return &result->slots[static_cast<uint32_t>(lobe) * stride_ + place.slot];
  }

  const GatherKernels& kernels_;
  const ReadOut read_out_;
  const uint32_t stride_;  ///< SlotLayout's
};

}  // namespace glint
