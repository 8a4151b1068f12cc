#include "common/domain/bake_settings.h"

namespace glint {

void HashSettings(const BakeSettings& s, Hasher* hasher) {
  hasher->Add(s.method)
      .Add(s.grid_level)
      .Add(s.angular_tolerance)
      .Add(s.base_level)
      .Add(s.rays_per_kappa)
      .Add(s.min_rays)
      .Add(s.max_rays)
      .Add(s.split_levels)
      .Add(s.own_rays)
      .Add(s.paper_rays)
      .Add(s.drop)
      .Add(s.bits_tolerance)
      .Add(s.slice_lobes)
      .Add(s.lobe_tolerance)
      .Add(s.seed)
      .Add(s.fit.max_lobes)
      .Add(s.fit.tolerance)
      .Add(s.spatial_tolerance)
      .Add(s.smallest_edge)
      .Add(s.max_vertices)
      .Add(s.subdivide);
  // Direct light once had one lobe whatever slice_lobes was; keys of bakes with one lobe are as they were.
  if (s.slice_lobes > 1) hasher->Add(1);
}

}  // namespace glint
