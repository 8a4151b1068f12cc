#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "common/base/frame.h"
#include "common/domain/direction_grid.h"
#include "common/lobes/slice_sampler.h"
#include "common/lobes/vmf.h"
#include "worker/gather_kernel.h"

namespace glint {

/// The lobes of a vertex side's slices, pointed to where they are in its lattice's frame. All view directions
/// are done at once, in arrays: one by one their roots and divisions took as long as the sums. Buffers are
/// reused.
class AimedLobes {
 public:
  /// Takes those of `columns` directions from `first` on that are above the side.
  /// @param frame      the side's lattice's
  /// @param max_kappa  of what samples are weighed by
  void Aim(const DirectionGrid& grid, uint32_t first, uint32_t columns, const SliceSampler& sampler,
           const Frame& frame, float max_kappa);

  int lobes() const { return static_cast<int>(lobes_.size()); }  ///< of each slice
  /// Slices, by ascending column.
  size_t size() const { return column_.size(); }
  uint16_t column(size_t i) const { return column_[i]; }
  /// What samples are weighed by, of lobe k of slice i; and where that is not nothing.
  LobeWeight weight(size_t i, int k) const;
  QueryCone cone(size_t i, int k) const;
  /// The fitted lobe itself, in the lattice's frame.
  Vmf fitted(size_t i, int k) const { return {Point(lobes_[k].fitted, i), lobes_[k].fitted.kappa[i]}; }
  /// Share of the fitted lobe's kappa that samples are weighed by.
  float resolution(size_t i, int k) const { return lobes_[k].resolution[i]; }
  /// The lobe as it is read out whole: its direction, in the lattice's frame, and kappa.
  glm::vec3 seen_mu(size_t i, int k) const;
  float seen_kappa(size_t i, int k) const { return lobes_[k].seen.kappa[i]; }

 private:
  struct Lobes {
    LobeArrays fitted, seen;
    std::vector<float> kappa, resolution;  ///< of the samples' weight
    std::vector<float> cos_radius, sin_radius;
  };
  void FindColumns(const DirectionGrid& grid, uint32_t first, uint32_t columns, const Frame& frame);
  void Bound(float max_kappa, Lobes* lobes) const;
  glm::vec3 Point(const LobeArrays& lobes, size_t i) const {
    return {plane_x_[i] * lobes.mu_x[i], plane_y_[i] * lobes.mu_x[i], lobes.mu_z[i]};
  }

  std::vector<uint16_t> column_;
  std::vector<float> plane_x_,
      plane_y_;  ///< of each slice: its plane of incidence's direction in the tangent plane
  std::vector<float> cos_o_;
  std::vector<Lobes> lobes_;
};

}  // namespace glint
