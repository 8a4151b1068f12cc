#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/blend.h"
#include "common/domain/bake_domain.h"
#include "common/domain/direction_grid.h"
#include "common/domain/facet_rows.h"
#include "common/lobes/slice_sampler.h"
#include "common/lobes/vmf.h"

namespace glint {

/// A point of the surface seen from `wo`, and all that the layers' look-ups share.
struct TransferPoint {
  uint32_t triangle = kNone;
  float u = 0, v = 0;
  glm::vec3 wo{0, 0, 1};              ///< unit, world, towards the viewer
  glm::vec3 normal{0, 0, 1};          ///< interpolated shading normal on wo's side, unit
  bool back = false;                  ///< seen from behind a double-sided surface
  float cos_o = 0;                    ///< normal . wo, > 0
  glm::vec3 specular{0}, diffuse{0};  ///< interpolated reflectance
  glm::vec3 diffuse_albedo{0};
  BrdfSlice slice;  ///< unoccluded lobes at cos_o, as AboveHorizon reads them out
  std::array<glm::vec3, kMaxBrdfLobes> lobe_mu;  ///< their directions, world
  std::array<uint32_t, 3> vertex{};              ///< of the triangle
  std::array<float, 3> vertex_weight{};          ///< barycentric
  int rows = 0;                                  ///< bake vertices that answer here
  std::array<uint32_t, kMaxPointRows> row{};
  std::array<float, kMaxPointRows> row_weight{};  ///< for slices that do not depend on wo; add up to 1
  std::array<uint32_t, 3> column{};               ///< grid directions around wo
  uint32_t grid_triangle = 0;                     ///< of them
  /// Weight of (row i, column j) at [3 i + j]: 0 where the direction lies under the row's own horizon (no
  /// slice is defined there), and the rest add up to 1.
  std::array<float, 3 * kMaxPointRows> corner_weight{};
  std::array<glm::vec3, kMaxPointRows> row_normal{};  ///< unit, of wo's side
  /// Of row i: the whole triangle of the grid's base level around wo is above its horizon.
  std::array<bool, kMaxPointRows> whole{};

  std::span<const uint32_t> Rows() const { return {row.data(), static_cast<size_t>(rows)}; }
};

/// One term of a point's transfer: radiance = alpha * (environment filtered by the lobe). With `cosine` set
/// the term is alpha * max(0, irradiance(normal) / pi - filtered(normal, kCosineKappa) + filtered(mu,
/// kappa)): the exact cosine lobe when nothing blocks it, and a smooth way from there.
struct TransferLobe {
  glm::vec3 alpha{0};  ///< linear RGB
  glm::vec3 mu{0, 0, 1};
  float kappa = 0;
  bool cosine = false;
};

/// vMF with the mean cosine 2/3 of the cosine lobe.
inline constexpr float kCosineKappa = 2.9871f;

/// At most this many lobes come from one layer at one point.
inline constexpr int kMaxLayerLobes = kMaxGroups * (kMaxBrdfLobes + 1);

/// Fixed list of a layer's lobes at a point.
struct LayerLobes {
  int count = 0;
  std::array<TransferLobe, kMaxLayerLobes> lobe;

  void Add(const TransferLobe& l) { lobe[count++] = l; }
};

/// x and z axes of the frame in which BrdfSlice lobes are given: wo lies in their plane on the positive x
/// side. At normal incidence, where every plane will do, x is some tangent.
std::array<glm::vec3, 2> IncidenceAxes(const glm::vec3& normal, const glm::vec3& wo);

/// Reads slices at any point and direction by interpolation over the bake vertices around and the grid
/// directions around wo (laurijssen2011 Eq. 7); lobes further apart than 2 / sqrt(kappa) are kept apart.
/// Thread-safe.
class TransferReader {
 public:
  TransferReader(const BakeDomain& domain, const DirectionGrid& grid);

  /// False where nothing is reflected: seen from behind a single-sided surface.
  bool Prepare(uint32_t triangle, float u, float v, const glm::vec3& wo, TransferPoint* point) const;
  /// Lobes of layer `index` (0: direct) at the point.
  void Read(const TransferPoint& point, const LayerViews& layer, int index, LayerLobes* out) const;

 private:
  bool OrientNormal(uint32_t triangle, const std::array<float, 3>& barycentric, TransferPoint* point) const;
  void InterpolateReflectance(const std::array<float, 3>& barycentric, TransferPoint* point) const;
  /// Bake vertices around the point and their weights.
  void FindRows(TransferPoint* point) const;
  void WeighCorners(TransferPoint* point) const;
  /// Corners' weights for the slices around `direction`. False if none of them is defined.
  bool WeighCornersAround(const glm::vec3& direction, TransferPoint* point) const;

  void CompareWithHorizons(TransferPoint* point) const;

  /// The slice between three shapes (textured roughness): lobe k of each taken together.
  BrdfSlice BlendSlices(const std::array<uint32_t, 3>& vertex, const std::array<float, 3>& weight,
                        float cos_o) const;

  const BakeDomain& domain_;
  const DirectionGrid& grid_;
  const FacetRows facet_rows_;
  std::vector<glm::vec3> row_normals_;
  std::vector<SliceSampler> samplers_;  ///< of domain_.shapes
};

}  // namespace glint
