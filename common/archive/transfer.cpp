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
#include "common/domain/bake_settings.h"

namespace glint {
namespace {

/// Unit vector along v, or `fallback` where v vanishes.
glm::vec3 NormalizeOr(const glm::vec3& v, const glm::vec3& fallback) {
  const float length2 = glm::dot(v, v);
  return length2 > 1e-20f ? v / std::sqrt(length2) : fallback;
}

/// Where a look-up reads: corner (vertex i, column j) has its weight at [i * kColumns + j].
template <int kColumns>
struct Corners {
  const std::array<uint32_t, 3>& vertex;
  const std::array<uint32_t, kColumns>& column;
  const std::array<float, 3 * kColumns>& weight;
};

/// Interpolates the direct lobe of one table. Corners without an entry are unblocked.
template <int kColumns>
DirectLobe InterpolateDirect(const SliceTableView& table, const Corners<kColumns>& corners) {
  float fraction = 0, kappa_ratio = 0;
  glm::vec3 shift(0);
  bool stored = false;
  for (int i = 0; i < 3; ++i) {
    const SliceTableView::RowView row = table.Row(corners.vertex[i]);
    for (int j = 0; j < kColumns; ++j) {
      const float w = corners.weight[i * kColumns + j];
      const std::byte* entry = row.empty() || w <= 0 ? nullptr : row.Find(corners.column[j]);
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

/// Lobes of a look-up's corners, gathered into groups of like ones. A group has at most one lobe of each
/// corner: what was stored as two lobes is not one thing.
class CornerGroups {
 public:
  struct Lobe {
    glm::vec3 alpha;  ///< times the corner's weight
    float strength;   ///< of alpha
    glm::vec3 mu;
    float kappa;
  };

  void Add(int corner, const Lobe& lobe) {
    if (lobe.strength <= 0) return;
    several_ = several_ || (count_ > 0 && corner_[count_ - 1] == corner);
    corner_[count_] = corner;
    lobe_[count_++] = lobe;
    AddTo(&total_, lobe);
  }
  /// Some corner has more than one lobe.
  bool several() const { return several_; }
  /// Sums over all lobes; mu and kappa times strength.
  const Lobe& total() const { return total_; }

  /// Calls emit(lobe) for every group, the one with the strongest lobe first. What is faint, or more than
  /// kMaxGroups, comes as one broad lobe.
  template <class Emit>
  void ForEach(const Emit& emit) {
    for (int group = 1; count_ > 0; ++group) {
      const int strongest = Strongest();
      if (group == kMaxGroups || lobe_[strongest].strength < kFaint * total_.strength) {
        emit(TakeRest());
      } else {
        emit(TakeLike(strongest));
      }
    }
  }

 private:
  static constexpr int kMaxCorners = 9;

  int Strongest() const {
    int strongest = 0;
    for (int i = 1; i < count_; ++i)
      if (lobe_[i].strength > lobe_[strongest].strength) strongest = i;
    return strongest;
  }

  /// Takes out a lobe, and of each other corner the nearest that is not far from it.
  Lobe TakeLike(int seed_index) {
    const Lobe seed = lobe_[seed_index];
    std::array<int, kMaxCorners> nearest;
    std::array<float, kMaxCorners> distance;
    nearest.fill(-1);
    distance.fill(kFar);
    for (int i = 0; i < count_; ++i) {
      const glm::vec3 d = lobe_[i].mu - seed.mu;
      const float scaled = glm::dot(d, d) * std::min(lobe_[i].kappa, seed.kappa);
      if (scaled <= distance[corner_[i]]) distance[corner_[i]] = scaled, nearest[corner_[i]] = i;
    }
    nearest[corner_[seed_index]] = seed_index;
    Lobe sum{glm::vec3(0), 0, glm::vec3(0), 0};
    int left = 0;
    for (int i = 0; i < count_; ++i) {
      if (nearest[corner_[i]] == i) {
        AddTo(&sum, lobe_[i]);
      } else {
        corner_[left] = corner_[i];
        lobe_[left++] = lobe_[i];
      }
    }
    count_ = left;
    return {sum.alpha, sum.strength, NormalizeOr(sum.mu, seed.mu), sum.kappa / sum.strength};
  }

  /// Takes all that are left as the lobe with their moments: they need not be alike.
  Lobe TakeRest() {
    Lobe sum{glm::vec3(0), 0, glm::vec3(0), 0};
    for (int i = 0; i < count_; ++i) AddTo(&sum, lobe_[i]);
    const float cosine = glm::length(sum.mu) / sum.strength;
    const float delta = 1 - cosine * (1 - DeltaFromKappa(sum.kappa / sum.strength));
    count_ = 0;
    return {sum.alpha, sum.strength, NormalizeOr(sum.mu, lobe_[0].mu),
            KappaFromDelta(std::clamp(delta, 0.0f, 1.0f))};
  }

  static void AddTo(Lobe* sum, const Lobe& lobe) {
    sum->alpha += lobe.alpha;
    sum->strength += lobe.strength;
    sum->mu += lobe.strength * lobe.mu;
    sum->kappa += lobe.strength * lobe.kappa;
  }

  /// Apart if the angle exceeds 2 / sqrt(kappa) of the broader lobe.
  static constexpr float kFar = 4;
  static constexpr float kFaint = 0.04f;  ///< of all corners' light

  std::array<Lobe, kMaxCorners * kMaxSliceLobes> lobe_;
  std::array<int, kMaxCorners * kMaxSliceLobes> corner_;
  int count_ = 0;
  bool several_ = false;
  Lobe total_{glm::vec3(0), 0, glm::vec3(0), 0};
};

/// Calls visit(corner, weight, lobe) for every stored lobe of the corners' slices.
template <int kColumns, class Visit>
void VisitIndirect(const LayerViews& layer, uint32_t slot, const Corners<kColumns>& corners,
                   const Visit& visit) {
  for (int i = 0; i < 3; ++i) {
    std::array<SliceTableView::RowView, kMaxSliceLobes> row;
    uint32_t lobes = 0;  // where a row is empty, so are those of further lobes
    for (; lobes < layer.lobes(); ++lobes) {
      row[lobes] = layer.table(lobes, slot).Row(corners.vertex[i]);
      if (row[lobes].empty()) break;
    }
    for (int j = 0; j < kColumns; ++j) {
      const int corner = i * kColumns + j;
      if (corners.weight[corner] <= 0) continue;
      for (uint32_t lobe = 0; lobe < lobes; ++lobe) {
        const std::byte* entry = row[lobe].Find(corners.column[j]);
        if (!entry) break;
        visit(corner, corners.weight[corner], DecodeIndirect(entry));
      }
    }
  }
}

/// Adds the lobes of an indirect slice; `scale` is the BRDF lobe's weight.
template <int kColumns>
void ReadIndirect(const LayerViews& layer, uint32_t slot, const Corners<kColumns>& corners,
                  const glm::vec3& scale, LayerLobes* out) {
  CornerGroups groups;
  VisitIndirect<kColumns>(layer, slot, corners, [&](int corner, float w, const IndirectLobe& lobe) {
    const glm::vec3 alpha = w * lobe.alpha;
    groups.Add(corner, {alpha, Luminance(alpha), lobe.mu, lobe.kappa});
  });
  const auto emit = [&](const CornerGroups::Lobe& lobe) {
    out->Add({lobe.alpha * scale, lobe.mu, lobe.kappa, false});
  };
  // 1 - |mean of mu| is the corners' mean 1 - cos from their common direction: mostly they are alike, which
  // saves the comparing. Corners' rms angle is then at most 1 / sqrt(kappa).
  constexpr float kAlike = 0.5f;
  const CornerGroups::Lobe& all = groups.total();
  if (all.strength <= 0) return;
  const float length = glm::length(all.mu);
  const bool alike = (all.strength - length) * all.kappa <= kAlike * all.strength * all.strength;
  if (alike && length > 0 && !groups.several()) {
    emit({all.alpha, all.strength, all.mu / length, all.kappa / all.strength});
  } else {
    groups.ForEach(emit);
  }
}

}  // namespace

std::array<glm::vec3, 2> IncidenceAxes(const glm::vec3& normal, const glm::vec3& wo) {
  const glm::vec3 tangent = wo - normal * glm::dot(normal, wo);
  const float length2 = glm::dot(tangent, tangent);
  return {length2 > 1e-12f ? tangent / std::sqrt(length2) : Frame::FromNormal(normal).t, normal};
}

TransferReader::TransferReader(const BakeDomain& domain, const DirectionGrid& grid)
    : domain_(domain), grid_(grid), samplers_(MakeSliceSamplers(domain.shapes)) {}

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
  for (int i = 0; i < 3; ++i) n += point->vertex_weight[i] * domain_.normals[point->vertex[i]];
  WeighCornersAround(NormalizeOr(point->back ? -n : n, point->normal), point);
}

bool TransferReader::WeighCornersAround(const glm::vec3& direction, TransferPoint* point) const {
  const DirectionGrid::Location location = grid_.Locate(direction);
  point->column = location.index;
  const float side = point->back ? -1.0f : 1.0f;
  float total = 0;
  for (int i = 0; i < 3; ++i) {
    const glm::vec3 n = side * domain_.normals[point->vertex[i]];
    for (int j = 0; j < 3; ++j) {
      const bool defined = glm::dot(n, grid_.direction(location.index[j])) > 0;
      const float w = defined ? point->vertex_weight[i] * location.weight[j] : 0.0f;
      point->corner_weight[3 * i + j] = w;
      total += w;
    }
  }
  const float scale = total > 0 ? 1 / total : 0;
  for (float& w : point->corner_weight) w *= scale;
  return total > 0;
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
  WeighCorners(point);
  return true;
}

void TransferReader::Read(const TransferPoint& point, const LayerViews& layer, int index,
                          LayerLobes* out) const {
  out->count = 0;
  const Corners<3> corners{point.vertex, point.column, point.corner_weight};
  for (int k = 0; k < point.slice.lobes; ++k) {
    const BrdfLobe& brdf = point.slice.lobe[k];
    const glm::vec3 weight = brdf.Weight(point.specular);
    if (index > 0) {
      ReadIndirect(layer, static_cast<uint32_t>(k), corners, weight, out);
      continue;
    }
    const DirectLobe direct = InterpolateDirect(layer.specular[k], corners);
    if (direct.fraction > 0)
      out->Add({weight * direct.fraction, NormalizeOr(point.lobe_mu[k] + direct.shift, point.lobe_mu[k]),
                std::min(brdf.kappa * direct.kappa_ratio, kMaxKappa), false});
  }
  if (point.diffuse_albedo.x + point.diffuse_albedo.y + point.diffuse_albedo.z <= 0) return;
  const std::array<uint32_t, 1> side = {point.back ? 1u : 0u};
  const Corners<1> vertices{point.vertex, side, point.vertex_weight};
  if (index > 0) {
    ReadIndirect(layer, layer.diffuse_slot(), vertices, point.diffuse_albedo, out);
    return;
  }
  const DirectLobe direct = InterpolateDirect(layer.diffuse, vertices);
  if (direct.fraction > 0)
    out->Add({point.diffuse_albedo * direct.fraction, NormalizeOr(point.normal + direct.shift, point.normal),
              kCosineKappa * direct.kappa_ratio, true});
}

}  // namespace glint
