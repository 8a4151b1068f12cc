// Reading slices between the baked vertices and directions: laurijssen2011 Eq. 7, with three changes. Direct
// lobes are interpolated relative to the unoccluded lobe at the very point and direction, so that sharp
// mirror images stay sharp; a lobe's weight also weighs its direction and width, so that a lobe which fades
// out does not pull the others; and lobes further apart than 2 / sqrt(kappa) are never averaged.
#include "common/archive/transfer.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/archive/blend.h"
#include "common/archive/lobe_codec.h"
#include "common/archive/nested.h"
#include "common/base/bend_normal.h"
#include "common/base/frame.h"
#include "common/domain/bake_settings.h"

namespace glint {
namespace {

/// Where a look-up reads: corner (row i, column j) has its weight at [i * kColumns + j].
template <int kColumns>
struct Corners {
  std::span<const uint32_t> rows;
  const std::array<uint32_t, kColumns>& column;
  const std::array<float, kMaxPointRows * kColumns>& weight;
};

/// The same in nested tables: what stands in for the corners' slices.
struct NestedCorners {
  const DirectionGrid& grid;
  const TransferPoint& point;

  /// VisitStandIns in the i-th row.
  template <class Visit>
  void VisitRow(int i, const SliceTableView::RowView& row, const Visit& visit) const {
    const float* w = &point.corner_weight[3 * i];
    if (w[0] + w[1] + w[2] <= 0) return;
    const auto find = [&](uint32_t column) { return row.empty() ? nullptr : row.Find(column); };
    const auto stand_ins = [&](const auto& above) {
      VisitStandIns(grid, grid.level(), point.grid_triangle, {w[0], w[1], w[2]}, above, find, visit);
    };
    if (point.whole[i]) {
      stand_ins([](uint32_t) { return true; });
    } else {
      const glm::vec3& n = point.row_normal[i];
      stand_ins([&](uint32_t column) { return glm::dot(n, grid.direction(column)) > 0; });
    }
  }
};

/// Interpolates the direct lobe of one table. Corners without an entry are unblocked.
template <int kColumns>
DirectLobe InterpolateDirect(const SliceTableView& table, const Corners<kColumns>& corners) {
  DirectBlend blend;
  for (size_t i = 0; i < corners.rows.size(); ++i) {
    const SliceTableView::RowView row = table.Row(corners.rows[i]);
    for (int j = 0; j < kColumns; ++j) {
      const float w = corners.weight[i * kColumns + j];
      const std::byte* entry = row.empty() || w <= 0 ? nullptr : row.Find(corners.column[j]);
      if (entry) {
        blend.Add(w, DecodeDirect(entry, table.entry_bytes()));
      } else {
        blend.AddFree(w);
      }
    }
  }
  return blend.Lobe();
}

DirectLobe InterpolateDirect(const SliceTableView& table, const NestedCorners& corners) {
  DirectBlend blend;
  for (int i = 0; i < corners.point.rows; ++i)
    corners.VisitRow(i, table.Row(corners.point.row[i]), [&](uint32_t, float w, const std::byte* entry) {
      if (entry) {
        blend.Add(w, DecodeDirect(entry, table.entry_bytes()));
      } else {
        blend.AddFree(w);
      }
    });
  return blend.Lobe();
}

/// Rows of a bake vertex in a slot's tables, one for each lobe of a slice.
class LobeRows {
 public:
  LobeRows(const LayerViews& layer, uint32_t slot, uint32_t row) {
    // Where a row is empty, so are those of further lobes.
    for (; lobes_ < layer.lobes(); ++lobes_) {
      const SliceTableView& table = layer.table(lobes_, slot);
      row_[lobes_] = table.Row(row);
      entry_bytes_[lobes_] = table.entry_bytes();
      if (row_[lobes_].empty()) return;
    }
  }
  bool empty() const { return lobes_ == 0; }
  const SliceTableView::RowView& first() const { return row_[0]; }
  /// Calls visit(entry, its bytes) for the lobes of a slice, whose first is `entry`.
  template <class Visit>
  void ForEach(uint32_t column, const std::byte* entry, const Visit& visit) const {
    for (uint32_t lobe = 1; entry; ++lobe) {
      visit(entry, entry_bytes_[lobe - 1]);
      entry = lobe < lobes_ ? row_[lobe].Find(column) : nullptr;
    }
  }

 private:
  std::array<SliceTableView::RowView, kMaxSliceLobes> row_;
  std::array<uint32_t, kMaxSliceLobes> entry_bytes_;
  uint32_t lobes_ = 0;
};

/// Adds a corner's slice, whose first lobe is `entry`, to the blend of direct ones.
void AddCorner(const LobeRows& rows, uint32_t column, float weight, const std::byte* entry,
               SeveralBlend* blend) {
  if (!entry) {
    blend->AddFree(weight);
    return;
  }
  std::array<DirectLobe, kMaxSliceLobes> lobes;
  int count = 0;
  rows.ForEach(column, entry, [&](const std::byte* stored, uint32_t bytes) {
    lobes[count++] = DecodeDirect(stored, bytes);
  });
  blend->Add(weight, lobes.data(), count);
}

template <int kColumns>
void BlendSeveral(const LayerViews& layer, uint32_t slot, const Corners<kColumns>& corners,
                  SeveralBlend* blend) {
  for (size_t i = 0; i < corners.rows.size(); ++i) {
    const LobeRows rows(layer, slot, corners.rows[i]);
    for (int j = 0; j < kColumns; ++j) {
      const float w = corners.weight[i * kColumns + j];
      const uint32_t column = corners.column[j];
      AddCorner(rows, column, w, rows.empty() || w <= 0 ? nullptr : rows.first().Find(column), blend);
    }
  }
}

void BlendSeveral(const LayerViews& layer, uint32_t slot, const NestedCorners& corners, SeveralBlend* blend) {
  for (int i = 0; i < corners.point.rows; ++i) {
    const LobeRows rows(layer, slot, corners.point.row[i]);
    corners.VisitRow(i, rows.first(), [&](uint32_t column, float w, const std::byte* entry) {
      AddCorner(rows, column, w, entry, blend);
    });
  }
}

/// Calls visit(DirectLobe) for the lobes of a slice of layer 0.
template <class SomeCorners, class Visit>
void VisitDirect(const LayerViews& layer, uint32_t slot, const SomeCorners& corners, const Visit& visit) {
  if (layer.lobes() == 1) {
    visit(InterpolateDirect(layer.table(0, slot), corners));
    return;
  }
  SeveralBlend blend;
  BlendSeveral(layer, slot, corners, &blend);
  blend.Emit(visit);
}

/// Calls visit(corner, weight, lobe) for every stored lobe of the corners' slices.
template <int kColumns, class Visit>
void VisitIndirect(const LayerViews& layer, uint32_t slot, const Corners<kColumns>& corners,
                   const Visit& visit) {
  for (int i = 0; i < static_cast<int>(corners.rows.size()); ++i) {
    const LobeRows rows(layer, slot, corners.rows[i]);
    for (int j = 0; !rows.empty() && j < kColumns; ++j) {
      const int corner = i * kColumns + j;
      const float w = corners.weight[corner];
      if (w <= 0) continue;
      rows.ForEach(
          corners.column[j], rows.first().Find(corners.column[j]),
          [&](const std::byte* entry, uint32_t bytes) { visit(corner, w, DecodeIndirect(entry, bytes)); });
    }
  }
}

template <class Visit>
void VisitIndirect(const LayerViews& layer, uint32_t slot, const NestedCorners& corners, const Visit& visit) {
  int corner = 0;
  for (int i = 0; i < corners.point.rows; ++i) {
    const LobeRows rows(layer, slot, corners.point.row[i]);
    if (rows.empty()) continue;
    corners.VisitRow(i, rows.first(), [&](uint32_t column, float w, const std::byte* entry) {
      rows.ForEach(column, entry, [&](const std::byte* stored, uint32_t bytes) {
        visit(corner, w, DecodeIndirect(stored, bytes));
      });
      ++corner;
    });
  }
}

/// Adds the lobes of an indirect slice; `scale` is the BRDF lobe's weight.
template <class SomeCorners>
void ReadIndirect(const LayerViews& layer, uint32_t slot, const SomeCorners& corners, const glm::vec3& scale,
                  LayerLobes* out) {
  CornerGroups groups;
  VisitIndirect(layer, slot, corners, [&](int corner, float w, const IndirectLobe& lobe) {
    const glm::vec3 alpha = w * lobe.alpha;
    groups.Add(corner, {alpha, Luminance(alpha), lobe.mu, lobe.kappa});
  });
  groups.Emit([&](const CornerGroups::Lobe& lobe) {
    out->Add({lobe.alpha * scale, lobe.mu, lobe.kappa, false});
  });
}

/// Adds the lobes of a point's specular slices.
template <class SomeCorners>
void ReadSpecular(const TransferPoint& point, const LayerViews& layer, int index, const SomeCorners& corners,
                  LayerLobes* out) {
  for (int k = 0; k < point.slice.lobes; ++k) {
    const BrdfLobe& brdf = point.slice.lobe[k];
    const glm::vec3 weight = brdf.Weight(point.specular);
    if (index > 0) {
      ReadIndirect(layer, static_cast<uint32_t>(k), corners, weight, out);
      continue;
    }
    VisitDirect(layer, static_cast<uint32_t>(k), corners, [&](const DirectLobe& direct) {
      if (direct.fraction > 0)
        out->Add({weight * direct.fraction, UnitOr(point.lobe_mu[k] + direct.shift, point.lobe_mu[k]),
                  std::min(brdf.kappa * direct.kappa_ratio, kMaxKappa), false});
    });
  }
}

}  // namespace

std::array<glm::vec3, 2> IncidenceAxes(const glm::vec3& normal, const glm::vec3& wo) {
  const glm::vec3 tangent = wo - normal * glm::dot(normal, wo);
  const float length2 = glm::dot(tangent, tangent);
  return {length2 > 1e-12f ? tangent / std::sqrt(length2) : Frame::FromNormal(normal).t, normal};
}

TransferReader::TransferReader(const BakeDomain& domain, const DirectionGrid& grid)
    : domain_(domain), grid_(grid), facet_rows_(domain), samplers_(MakeSliceSamplers(domain.shapes)) {
  row_normals_.reserve(domain.row_count());
  for (uint32_t row = 0; row < domain.row_count(); ++row) row_normals_.push_back(domain.Row(row).normal);
}

BrdfSlice TransferReader::BlendSlices(const std::array<uint32_t, 3>& vertex,
                                      const std::array<float, 3>& weight, float cos_o) const {
  BrdfSlice out;
  std::array<float, kMaxBrdfLobes> total{};
  std::array<float, kMaxBrdfLobes> log_kappa{};
  for (auto& l : out.lobe) l = {.mu_x = 0, .mu_z = 0, .above = 0};
  for (int i = 0; i < 3; ++i) {
    if (weight[i] <= 0) continue;
    const BrdfSlice slice = samplers_[domain_.shape[vertex[i]]].Seen(cos_o);
    out.lobes = std::max(out.lobes, slice.lobes);
    for (int k = 0; k < slice.lobes; ++k) {
      BrdfLobe& l = out.lobe[k];
      l.mu_x += weight[i] * slice.lobe[k].mu_x;
      l.mu_z += weight[i] * slice.lobe[k].mu_z;
      l.scale += weight[i] * slice.lobe[k].scale;
      l.bias += weight[i] * slice.lobe[k].bias;
      l.above += weight[i] * slice.lobe[k].above;
      log_kappa[k] += weight[i] * std::log(std::max(slice.lobe[k].kappa, 1e-6f));
      total[k] += weight[i];
    }
  }
  for (int k = 0; k < out.lobes; ++k) {
    BrdfLobe& l = out.lobe[k];
    const float length = std::sqrt(l.mu_x * l.mu_x + l.mu_z * l.mu_z);
    if (length > 0) l.mu_x /= length, l.mu_z /= length;
    l.kappa = std::exp(log_kappa[k] / total[k]);
    l.above /= total[k];
  }
  return out;
}

bool TransferReader::OrientNormal(uint32_t triangle, const std::array<float, 3>& barycentric,
                                  TransferPoint* point) const {
  const auto& t = domain_.triangles[triangle];
  glm::vec3 face = domain_.FaceNormal(triangle);
  if (face == glm::vec3(0)) face = point->wo;
  point->back = glm::dot(face, point->wo) < 0;
  if (point->back && !domain_.triangle_double_sided[triangle]) return false;
  const float side = point->back ? -1.0f : 1.0f;
  face *= side;
  const glm::vec3 n =
      UnitOr(side * (barycentric[0] * domain_.normals[t[0]] + barycentric[1] * domain_.normals[t[1]] +
                     barycentric[2] * domain_.normals[t[2]]),
             face);
  point->normal = BendNormal(face, point->wo, n);
  point->cos_o = std::max(glm::dot(point->normal, point->wo), kMinCosine);
  return true;
}

void TransferReader::InterpolateReflectance(const std::array<float, 3>& barycentric,
                                            TransferPoint* point) const {
  const auto& v = point->vertex;
  point->specular = point->diffuse = glm::vec3(0);
  for (int i = 0; i < 3; ++i) {
    point->specular += barycentric[i] * domain_.specular[v[i]];
    point->diffuse += barycentric[i] * domain_.diffuse[v[i]];
  }
  const uint16_t shape = domain_.shape[v[0]];
  const bool one_shape = shape == domain_.shape[v[1]] && shape == domain_.shape[v[2]];
  point->slice = one_shape ? samplers_[shape].Seen(point->cos_o) : BlendSlices(v, barycentric, point->cos_o);
  const auto [tangent, normal] = IncidenceAxes(point->normal, point->wo);
  for (int k = 0; k < point->slice.lobes; ++k) {
    point->lobe_mu[k] = tangent * point->slice.lobe[k].mu_x + normal * point->slice.lobe[k].mu_z;
  }
  point->diffuse_albedo = glm::vec3(0);
  if (point->diffuse.x + point->diffuse.y + point->diffuse.z > 0)
    point->diffuse_albedo = DiffuseAlbedo(
        {domain_.shapes[shape].model, domain_.shapes[shape].shape, point->specular, point->diffuse},
        point->cos_o);
}

void TransferReader::WeighCorners(TransferPoint* point) const {
  if (WeighCornersAround(point->wo, point)) return;
  // Normals at odds with their face: wo is under the horizon of every corner. The slices for the direction of
  // the interpolated normal n stand in; one of them is defined, as the sum of w_i n_i . n is |n|^2.
  glm::vec3 n(0);
  for (int i = 0; i < point->rows; ++i) n += point->row_weight[i] * row_normals_[point->row[i]];
  WeighCornersAround(UnitOr(point->back ? -n : n, point->normal), point);
}

bool TransferReader::WeighCornersAround(const glm::vec3& direction, TransferPoint* point) const {
  const DirectionGrid::Location location = grid_.Locate(direction);
  point->column = location.index;
  point->grid_triangle = location.triangle;
  const float side = point->back ? -1.0f : 1.0f;
  float total = 0;
  for (int i = 0; i < point->rows; ++i) {
    const glm::vec3 n = side * row_normals_[point->row[i]];
    point->row_normal[i] = n;
    for (int j = 0; j < 3; ++j) {
      const bool defined = glm::dot(n, grid_.direction(location.index[j])) > 0;
      const float w = defined ? point->row_weight[i] * location.weight[j] : 0.0f;
      point->corner_weight[3 * i + j] = w;
      total += w;
    }
  }
  const float scale = total > 0 ? 1 / total : 0;
  for (int i = 0; i < 3 * point->rows; ++i) point->corner_weight[i] *= scale;
  if (grid_.nested()) CompareWithHorizons(point);
  return total > 0;
}

void TransferReader::CompareWithHorizons(TransferPoint* point) const {
  const int levels = grid_.level() - grid_.base_level();
  const auto& corners = grid_.triangles(grid_.base_level())[point->grid_triangle >> (2 * levels)];
  for (int i = 0; i < point->rows; ++i) {
    const glm::vec3& n = point->row_normal[i];
    point->whole[i] = std::all_of(corners.begin(), corners.end(),
                                  [&](uint32_t column) { return glm::dot(n, grid_.direction(column)) > 0; });
  }
}

void TransferReader::FindRows(TransferPoint* point) const {
  std::array<float, 3> weight = point->vertex_weight;
  float total = 0;
  point->rows = 0;
  for (const FacetRows::Row& row : facet_rows_.Locate(point->triangle, &weight)) {
    const float w = row.At(weight);
    point->row[point->rows] = row.row;
    point->row_weight[point->rows++] = w;
    total += w;
  }
  // Less than 1 only beside nodes for which nobody answers.
  if (total > 0 && total < 0.999f)
    for (int i = 0; i < point->rows; ++i) point->row_weight[i] /= total;
}

bool TransferReader::Prepare(uint32_t triangle, float u, float v, const glm::vec3& wo,
                             TransferPoint* point) const {
  point->triangle = triangle;
  point->u = u;
  point->v = v;
  point->wo = wo;
  point->vertex = domain_.triangles[triangle];
  point->vertex_weight = {1 - u - v, u, v};
  if (!OrientNormal(triangle, point->vertex_weight, point)) return false;
  InterpolateReflectance(point->vertex_weight, point);
  FindRows(point);
  WeighCorners(point);
  return true;
}

void TransferReader::Read(const TransferPoint& point, const LayerViews& layer, int index,
                          LayerLobes* out) const {
  out->count = 0;
  if (layer.nested) {
    ReadSpecular(point, layer, index, NestedCorners{grid_, point}, out);
  } else {
    ReadSpecular(point, layer, index, Corners<3>{point.Rows(), point.column, point.corner_weight}, out);
  }
  if (point.diffuse_albedo.x + point.diffuse_albedo.y + point.diffuse_albedo.z <= 0) return;
  const std::array<uint32_t, 1> side = {point.back ? 1u : 0u};
  const Corners<1> corners{point.Rows(), side, point.row_weight};
  if (index > 0) {
    ReadIndirect(layer, layer.diffuse_slot(), corners, point.diffuse_albedo, out);
    return;
  }
  VisitDirect(layer, layer.diffuse_slot(), corners, [&](const DirectLobe& direct) {
    if (direct.fraction > 0)
      out->Add({point.diffuse_albedo * direct.fraction, UnitOr(point.normal + direct.shift, point.normal),
                kCosineKappa * direct.kappa_ratio, true});
  });
}

}  // namespace glint
