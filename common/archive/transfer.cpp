// Reading slices between the baked vertices and directions: laurijssen2011 Eq. 7, with three changes. Direct
// lobes are interpolated relative to the unoccluded lobe at the very point and direction, so that sharp
// mirror images stay sharp; a lobe's weight also weighs its direction and width, so that a lobe which fades
// out does not pull the others; and lobes further apart than 2 / sqrt(kappa) are never averaged.
#include "common/archive/transfer.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/archive/lobe_codec.h"
#include "common/base/bend_normal.h"
#include "common/base/frame.h"

namespace glint {
namespace {

/// Unit vector along v, or `fallback` where v vanishes.
glm::vec3 NormalizeOr(const glm::vec3& v, const glm::vec3& fallback) {
  const float length2 = glm::dot(v, v);
  return length2 > 1e-20f ? v / std::sqrt(length2) : fallback;
}

/// Interpolates the direct lobe of one table. Corners without an entry are unblocked.
/// @param weight  of corner (row i, column j) at [i * columns + j]
template <int kColumns>
DirectLobe InterpolateDirect(const SliceTableView& table, const TransferPoint& point,
                             const std::array<uint32_t, kColumns>& column,
                             const std::array<float, kColumns * kMaxPointRows>& weight) {
  float fraction = 0, kappa_ratio = 0;
  glm::vec3 shift(0);
  bool stored = false;
  for (int i = 0; i < point.rows; ++i) {
    const SliceTableView::RowView row = table.Row(point.row[i]);
    for (int j = 0; j < kColumns; ++j) {
      const float w = weight[i * kColumns + j];
      const std::byte* entry = row.empty() || w <= 0 ? nullptr : row.Find(column[j]);
      if (!entry) {
        fraction += w;
        kappa_ratio += w;
        continue;
      }
      const DirectLobe lobe = DecodeDirect(entry);
      const float visible = w * lobe.fraction;
      fraction += visible;
      shift += visible * lobe.shift;
      kappa_ratio += visible * lobe.kappa_ratio;
      stored = true;
    }
  }
  if (!stored) return {};
  if (fraction <= 0) return {.fraction = 0};
  return {std::min(fraction, 1.0f), shift / fraction, kappa_ratio / fraction};
}

/// Present corners of an indirect lobe, gathered into groups of like lobes.
class CornerGroups {
 public:
  void Add(float weight, const IndirectLobe& lobe) {
    const float strength = weight * Luminance(lobe.alpha);
    corner_[count_++] = {weight, strength, lobe};
    alpha_ += weight * lobe.alpha;
    mu_ += strength * lobe.mu;
    kappa_ += strength * lobe.kappa;
    strength_ += strength;
  }

  /// Emits one lobe per group, strongest corner first; `scale` is the BRDF lobe's weight.
  void Emit(const glm::vec3& scale, LayerLobes* out) {
    if (strength_ <= 0) return;
    // 1 - |mean of mu| is the corners' mean 1 - cos from their common direction: mostly they are alike, which
    // saves the comparing.
    const float length = glm::length(mu_);
    if ((strength_ - length) * kappa_ <= kAlike * strength_ * strength_ && length > 0) {
      out->Add({alpha_ * scale, mu_ / length, kappa_ / strength_, false});
      return;
    }
    for (int group = 0; group < kMaxGroups && count_ > 0; ++group) {
      const bool last = group == kMaxGroups - 1;
      EmitGroup(scale, last, out);
    }
  }

 private:
  static constexpr float kAlike = 0.5f;  ///< corners' rms angle is at most 1 / sqrt(kappa)

  struct Corner {
    float weight, strength;
    IndirectLobe lobe;
  };

  void EmitGroup(const glm::vec3& scale, bool take_all, LayerLobes* out) {
    int strongest = 0;
    for (int i = 1; i < count_; ++i)
      if (corner_[i].strength > corner_[strongest].strength) strongest = i;
    const IndirectLobe seed = corner_[strongest].lobe;
    glm::vec3 alpha(0), mu(0);
    float kappa = 0, strength = 0;
    int left = 0;
    for (int i = 0; i < count_; ++i) {
      const Corner& c = corner_[i];
      // |mu0 - mu1|^2 = 2 (1 - cos): apart if the angle exceeds 2 / sqrt(kappa) of the broader lobe.
      const bool near = (1 - glm::dot(c.lobe.mu, seed.mu)) * std::min(c.lobe.kappa, seed.kappa) <= 2;
      if (near || take_all) {
        alpha += c.weight * c.lobe.alpha;
        mu += c.strength * c.lobe.mu;
        kappa += c.strength * c.lobe.kappa;
        strength += c.strength;
      } else {
        corner_[left++] = c;
      }
    }
    count_ = left;
    if (strength > 0) out->Add({alpha * scale, NormalizeOr(mu, seed.mu), kappa / strength, false});
  }

  std::array<Corner, 3 * kMaxPointRows> corner_;
  int count_ = 0;
  glm::vec3 alpha_{0}, mu_{0};  ///< sums over all corners
  float kappa_ = 0, strength_ = 0;
};

template <int kColumns>
void InterpolateIndirect(const SliceTableView& table, const TransferPoint& point,
                         const std::array<uint32_t, kColumns>& column,
                         const std::array<float, kColumns * kMaxPointRows>& weight, const glm::vec3& scale,
                         LayerLobes* out) {
  CornerGroups groups;
  for (int i = 0; i < point.rows; ++i) {
    const SliceTableView::RowView row = table.Row(point.row[i]);
    if (row.empty()) continue;
    for (int j = 0; j < kColumns; ++j) {
      const float w = weight[i * kColumns + j];
      if (w <= 0) continue;
      if (const std::byte* entry = row.Find(column[j])) groups.Add(w, DecodeIndirect(entry));
    }
  }
  groups.Emit(scale, out);
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
      NormalizeOr(side * (barycentric[0] * domain_.normals[t[0]] + barycentric[1] * domain_.normals[t[1]] +
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
  WeighCornersAround(NormalizeOr(point->back ? -n : n, point->normal), point);
}

bool TransferReader::WeighCornersAround(const glm::vec3& direction, TransferPoint* point) const {
  const DirectionGrid::Location location = grid_.Locate(direction);
  point->column = location.index;
  const float side = point->back ? -1.0f : 1.0f;
  float total = 0;
  for (int i = 0; i < point->rows; ++i) {
    const glm::vec3 n = side * row_normals_[point->row[i]];
    for (int j = 0; j < 3; ++j) {
      const bool defined = glm::dot(n, grid_.direction(location.index[j])) > 0;
      const float w = defined ? point->row_weight[i] * location.weight[j] : 0.0f;
      point->corner_weight[3 * i + j] = w;
      total += w;
    }
  }
  const float scale = total > 0 ? 1 / total : 0;
  for (int i = 0; i < 3 * point->rows; ++i) point->corner_weight[i] *= scale;
  return total > 0;
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
  if (!PrepareSurface(triangle, u, v, wo, point)) return false;
  FindRows(point);
  WeighCorners(point);
  return true;
}

bool TransferReader::Prepare(const SurfacePlace& place, const glm::vec3& wo, std::span<const RowWeight> rows,
                             TransferPoint* point) const {
  if (!PrepareSurface(place.triangle, place.u, place.v, wo, point)) return false;
  point->rows = 0;
  for (const RowWeight& row : rows) {
    point->row[point->rows] = row.row;
    point->row_weight[point->rows++] = row.value();
  }
  WeighCorners(point);
  return true;
}

bool TransferReader::PrepareSurface(uint32_t triangle, float u, float v, const glm::vec3& wo,
                                    TransferPoint* point) const {
  point->triangle = triangle;
  point->u = u;
  point->v = v;
  point->wo = wo;
  point->vertex = domain_.triangles[triangle];
  point->vertex_weight = {1 - u - v, u, v};
  if (!OrientNormal(triangle, point->vertex_weight, point)) return false;
  InterpolateReflectance(point->vertex_weight, point);
  return true;
}

void TransferReader::Read(const TransferPoint& point, const LayerViews& layer, int index,
                          LayerLobes* out) const {
  out->count = 0;
  const uint32_t side = point.back ? 1 : 0;
  const bool diffuse = point.diffuse_albedo.x + point.diffuse_albedo.y + point.diffuse_albedo.z > 0;
  for (int k = 0; k < point.slice.lobes; ++k) {
    const BrdfLobe& brdf = point.slice.lobe[k];
    const glm::vec3 weight = brdf.Weight(point.specular);
    if (index > 0) {
      InterpolateIndirect<3>(layer.specular[k], point, point.column, point.corner_weight, weight, out);
      continue;
    }
    const DirectLobe direct =
        InterpolateDirect<3>(layer.specular[k], point, point.column, point.corner_weight);
    if (direct.fraction > 0)
      out->Add({weight * direct.fraction, NormalizeOr(point.lobe_mu[k] + direct.shift, point.lobe_mu[k]),
                std::min(brdf.kappa * direct.kappa_ratio, kMaxKappa), false});
  }
  if (!diffuse) return;
  if (index > 0) {
    InterpolateIndirect<1>(layer.diffuse, point, {side}, point.row_weight, point.diffuse_albedo, out);
    return;
  }
  const DirectLobe direct = InterpolateDirect<1>(layer.diffuse, point, {side}, point.row_weight);
  if (direct.fraction > 0)
    out->Add({point.diffuse_albedo * direct.fraction, NormalizeOr(point.normal + direct.shift, point.normal),
              kCosineKappa * direct.kappa_ratio, true});
}

}  // namespace glint
