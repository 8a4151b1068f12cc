#include "worker/layer_light.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <string>

#include "common/archive/lobe_codec.h"
#include "common/archive/merge_lobes.h"
#include "common/archive/nested.h"
#include "common/archive/row_sums.h"
#include "common/archive/transfer.h"
#include "common/base/bend_normal.h"
#include "common/base/frame.h"
#include "common/base/half.h"
#include "common/base/parallel.h"
#include "common/domain/bake_settings.h"
#include "common/lobes/vmf.h"
#include "worker/slice_lobes.h"

namespace glint {
namespace {

typedef float Float4 __attribute__((vector_size(16)));
typedef uint32_t Uint4 __attribute__((vector_size(16)));
typedef int32_t Int4 __attribute__((vector_size(16)));
typedef uint16_t Half4 __attribute__((vector_size(8)));
typedef int16_t Short4 __attribute__((vector_size(8)));

constexpr float kDeltaScale = 1024;  ///< keeps s delta in the normal range of a half
constexpr float kAlike = 0.5f;  ///< corners are averaged while their rms angle is at most 1 / sqrt(kappa)

/// Four halves that are not negative: their bits are a float's, but for the exponent's bias.
inline Float4 DecodeHalves(const void* p) {
  Half4 half;
  std::memcpy(&half, p, sizeof half);
  const Uint4 bits = __builtin_convertvector(half, Uint4) << 13;
  Float4 value;
  std::memcpy(&value, &bits, sizeof value);
  return value * 0x1p112f;
}

inline Float4 Load(const std::array<float, 4>& a) {
  Float4 value;
  std::memcpy(&value, a.data(), sizeof value);
  return value;
}

inline Float4 DecodeShorts(const void* p) {
  Short4 code;
  std::memcpy(&code, p, sizeof code);
  return __builtin_convertvector(__builtin_convertvector(code, Int4), Float4);
}

/// To the nearest, halves away from zero; unlike std::lround no call.
int16_t EncodeSnorm(float x) {
  const double scaled = std::clamp(x, -1.0f, 1.0f) * 32767.0f;
  return static_cast<int16_t>(scaled + std::copysign(0.5, scaled));
}

float MeanCosine(float kappa) {
  // Beyond kappa = 12 the hyperbolic cotangent is 1 to the last bit of a float.
  return kappa > 12 ? 1 - 1 / kappa : MeanCosineFromKappa(kappa);
}

/// Decodes the lobes of a slice; returns how many there are.
/// @param stored  the first of them
template <class Lobe, class Decode>
uint32_t ReadLobes(const LayerViews& views, uint32_t slot, uint32_t v, uint32_t column,
                   const std::byte* stored, std::array<Lobe, kMaxSliceLobes>* lobes, const Decode& decode) {
  uint32_t count = 0;
  while (stored) {
    (*lobes)[count] = decode(stored, views.table(count, slot).entry_bytes());
    ++count;
    stored = count < views.lobes() ? views.table(count, slot).Find(v, column) : nullptr;
  }
  return count;
}

}  // namespace

/// A look-up between its stages.
struct LayerLight::Pending {
  const Triangle* triangle;
  std::array<float, 3> barycentric;
  float side;  ///< -1: seen from behind
  glm::vec3 wo, normal;
  float cos_o;
  bool defined;  ///< some corner has a slice for wo; else the weights are 0, and the BRDF counts as free
  bool stored;   ///< some corner has an entry; else nothing of an indirect layer is reflected specularly
  std::array<uint32_t, 3> word, bit;  ///< of the three directions in a row's words
  int rows;                           ///< bake vertices that answer
  std::array<uint32_t, kMaxPointRows> row;
  std::array<float, kMaxPointRows> row_weight;
  std::array<std::array<float, 4>, kMaxPointRows> weight;  ///< of (row i, direction j)
  std::array<const Entry*, 3 * kMaxPointRows> entry;       ///< at [3 i + j]: of lobe 0
};

/// Weighted sums over corners: of Entry::linear, and of strength times Entry::vector.
struct LayerLight::Sums {
  Float4 linear = {}, vector = {};
  float strength = 0;
  void Add(float weight, const Entry& entry) {
    const Float4 first = DecodeHalves(&entry.linear), second = DecodeHalves(&entry.vector);
    linear += weight * first;
    const float share = weight * second[3];
    strength += share;
    vector += share * DecodeShorts(&entry.vector);
  }
  glm::vec3 rgb() const { return {linear[0], linear[1], linear[2]}; }
  glm::vec3 direction() const { return glm::vec3(vector[0], vector[1], vector[2]) * (1 / 32767.0f); }
};

LayerLight::LayerLight(const BakeDomain& domain, const DirectionGrid& grid, const LayerViews& views,
                       int layer, int threads, std::span<const uint64_t> row_sums)
    : domain_(domain),
      grid_(grid),
      layer_(layer),
      lobes_(static_cast<int>(views.specular.size())),
      words_((grid.size() + kWordColumns - 1) / kWordColumns),
      samplers_(MakeSliceSamplers(domain.shapes)),
      views_(views),
      row_sums_(row_sums) {
#if defined(__x86_64__)
  wide_ = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
          __builtin_cpu_supports("popcnt");
#endif
  Entry absent{};
  if (layer == 0) absent = {{EncodeHalf(1), EncodeHalf(1), 0, 0}, {0, 0, 0}, EncodeHalf(1)};
  absent_.assign(static_cast<size_t>(std::max(lobes_, 1)), absent);
  row_words_ =
      reinterpret_cast<uint64_t*>(memory_.Allocate(size_t{domain.row_count()} * words_ * sizeof(uint64_t)));
  if (domain.has_diffuse()) diffuse_.assign(2 * static_cast<size_t>(domain.row_count()), absent_[0]);
  PackSurface();
  if (row_sums_.empty()) PackRows(threads);
}

void LayerLight::PackSurface() {
  triangles_.reserve(domain_.triangles.size());
  for (size_t i = 0; i < domain_.triangles.size(); ++i) {
    const auto& t = domain_.triangles[i];
    const bool one_shape =
        domain_.shape[t[0]] == domain_.shape[t[1]] && domain_.shape[t[0]] == domain_.shape[t[2]];
    triangles_.push_back(
        {t, domain_.FaceNormal(static_cast<uint32_t>(i)), domain_.triangle_double_sided[i], one_shape});
  }
  vertices_.reserve(domain_.vertex_count());
  for (uint32_t v = 0; v < domain_.vertex_count(); ++v)
    vertices_.push_back(
        {{domain_.normals[v], nullptr}, domain_.specular[v], domain_.diffuse[v], domain_.shape[v]});
  if (domain_.nodes.every_vertex()) return;
  facet_rows_.emplace(domain_);
  row_.reserve(domain_.row_count());
  for (uint32_t r = 0; r < domain_.row_count(); ++r) row_.push_back({domain_.Row(r).normal, nullptr});
}

/// The unoccluded lobe that a slice of layer 0 is relative to.
Vmf LayerLight::Whole(uint32_t slot, uint32_t v, uint32_t column) const {
  const BakeVertex vertex = domain_.Row(v);
  if (slot == static_cast<uint32_t>(lobes_))
    return {column == 0 ? vertex.normal : -vertex.normal, kCosineKappa};
  const glm::vec3& wo = grid_.direction(column);
  const SliceSampler& sampler = samplers_[vertex.shape];
  const UnoccludedSlice slice(sampler, glm::dot(vertex.normal, wo) > 0 ? vertex.normal : -vertex.normal, wo);
  const BrdfLobe seen = slice.Seen(sampler, static_cast<int>(slot));
  return {slice.Direction(seen), seen.kappa};
}

LayerLight::Entry LayerLight::Pack(const LayerViews& views, uint32_t slot, uint32_t v, uint32_t column,
                                   const std::byte* stored) const {
  if (layer_ == 0) {
    std::array<DirectLobe, kMaxSliceLobes> lobes;
    const uint32_t count =
        ReadLobes(views, slot, v, column, stored, &lobes,
                  [](const std::byte* entry, uint32_t bytes) { return DecodeDirect(entry, bytes); });
    const DirectLobe lobe = count == 1 ? lobes[0] : MergeLobes({lobes.data(), count}, Whole(slot, v, column));
    return {{EncodeHalf(lobe.fraction), EncodeHalf(lobe.fraction * lobe.kappa_ratio), 0, 0},
            {EncodeSnorm(0.5f * lobe.shift.x), EncodeSnorm(0.5f * lobe.shift.y),
             EncodeSnorm(0.5f * lobe.shift.z)},
            EncodeHalf(lobe.fraction)};
  }
  std::array<IndirectLobe, kMaxSliceLobes> lobes;
  const uint32_t count =
      ReadLobes(views, slot, v, column, stored, &lobes,
                [](const std::byte* entry, uint32_t bytes) { return DecodeIndirect(entry, bytes); });
  const IndirectLobe lobe = count == 1 ? lobes[0] : MergeLobes({lobes.data(), count});
  const float strength = Luminance(lobe.alpha);
  const float spread = strength * (lobe.kappa > 0 ? DeltaFromKappa(lobe.kappa) : 1.0f) * kDeltaScale;
  return {{EncodeHalf(lobe.alpha.x), EncodeHalf(lobe.alpha.y), EncodeHalf(lobe.alpha.z), EncodeHalf(spread)},
          {EncodeSnorm(lobe.mu.x), EncodeSnorm(lobe.mu.y), EncodeSnorm(lobe.mu.z)},
          EncodeHalf(strength)};
}

void LayerLight::PackRows(int threads) {
  constexpr size_t kGrain = 256;
  ParallelFor(domain_.row_count(), threads, kGrain,
              [&](size_t v, int) { PackRowOf(static_cast<uint32_t>(v)); });
}

/// Makes what the layer stores of a row ready for look-ups.
void LayerLight::PackRowOf(uint32_t v) const {
  if (!diffuse_.empty())
    for (uint32_t side = 0; side < 2; ++side)
      if (const std::byte* stored = views_.table(0, views_.diffuse_slot()).Find(v, side))
        diffuse_[2 * size_t{v} + side] = Pack(views_, views_.diffuse_slot(), v, side, stored);
  const bool stored = std::any_of(views_.specular.begin(), views_.specular.end(),
                                  [&](const SliceTableView& table) { return !table.RowEmpty(v); });
  if (!stored) {
    PublishEmpty(v);
    return;
  }
  thread_local std::vector<Entry> slices;
  UnpackRow(views_, v, &slices);
  Publish(v, PackRow(slices, WordsOf(v)));
}

/// To look-ups in other threads. A row's words are written before.
inline void LayerLight::Publish(uint32_t v, const Entry* entries) const {
  __atomic_store_n(&RowAt(v).entries, entries, __ATOMIC_RELEASE);
}

void LayerLight::PublishEmpty(uint32_t v) const {
  std::fill_n(WordsOf(v), words_, 0);
  Publish(v, absent_.data());
}

/// A row's entries; from then on its words are there.
inline const LayerLight::Entry* LayerLight::Entries(uint32_t v) const {
  const Entry* entries = __atomic_load_n(&RowAt(v).entries, __ATOMIC_ACQUIRE);
  return entries ? entries : Reach(v);
}

/// The entries of a row that none, or just another, look-up has reached.
__attribute__((noinline)) const LayerLight::Entry* LayerLight::Reach(uint32_t v) const {
  const std::lock_guard lock(reaching_[v % reaching_.size()]);
  const Row& row = RowAt(v);
  if (row.entries) return row.entries;
  if (RowSum(views_, v) == row_sums_[v]) {
    PackRowOf(v);
  } else {
    damaged_row_ = v;
    PublishEmpty(v);
  }
  return row.entries;
}

Status LayerLight::status() const {
  const uint32_t row = damaged_row_;
  if (row == kNoRow) return {};
  return BadInput("row " + std::to_string(row) + " of the layer before is damaged");
}

/// Entries of all directions and lobes of a bake vertex, those that are predicted, too.
void LayerLight::UnpackRow(const LayerViews& views, uint32_t v, std::vector<Entry>* slices) const {
  slices->assign(grid_.size() * static_cast<size_t>(lobes_), absent_[0]);
  for (int k = 0; k < lobes_; ++k) {
    const auto slot = static_cast<uint32_t>(k);
    const SliceTableView::RowView row = views.specular[slot].Row(v);
    row.ForEach([&](uint32_t column, const std::byte* stored) {
      (*slices)[column * static_cast<size_t>(lobes_) + slot] = Pack(views, slot, v, column, stored);
    });
    if (views.nested && !row.empty()) PredictSlices(row, slot, v, slices);
  }
}

void LayerLight::PredictSlices(const SliceTableView::RowView& row, uint32_t slot, uint32_t v,
                               std::vector<Entry>* slices) const {
  const auto at = [&](uint32_t direction) -> Entry& {
    return (*slices)[direction * static_cast<size_t>(lobes_) + slot];
  };
  const BakeVertex vertex = domain_.Row(v);
  for (const float side : {1.0f, -1.0f}) {
    if (side < 0 && !vertex.double_sided) continue;
    const glm::vec3 n = side * vertex.normal;
    ForEachPredicted(
        grid_, [&](uint32_t d) { return glm::dot(n, grid_.direction(d)) > 0; },
        [&](uint32_t d) { return row.Find(d) != nullptr; },
        [&](uint32_t d, const std::array<uint32_t, 2>& ends, const std::array<float, 2>& share) {
          const Entry &a = at(ends[0]), &b = at(ends[1]);
          at(d) = share[0] == 1 || a == b ? a : share[1] == 1 ? b : Mean(a, b);
        });
  }
}

/// What half of each adds up to; Sums is linear in its entries.
LayerLight::Entry LayerLight::Mean(const Entry& a, const Entry& b) {
  Sums sums;
  sums.Add(0.5f, a);
  sums.Add(0.5f, b);
  Entry mean;
  for (int c = 0; c < 4; ++c) mean.linear[c] = EncodeHalf(sums.linear[c]);
  const glm::vec3 direction = sums.strength > 0 ? sums.direction() / sums.strength : glm::vec3(0);
  mean.vector = {EncodeSnorm(direction.x), EncodeSnorm(direction.y), EncodeSnorm(direction.z)};
  mean.strength = EncodeHalf(sums.strength);
  return mean;
}

/// Packs the entries of directions that differ in some lobe from what an absent one stands for.
/// @param words  the row's, to be written
const LayerLight::Entry* LayerLight::PackRow(const std::vector<Entry>& slices, uint64_t* words) const {
  const auto lobes = static_cast<size_t>(lobes_);
  uint64_t rank = 0;
  for (uint32_t first = 0; first < grid_.size(); first += kWordColumns) {
    const uint32_t columns = std::min(kWordColumns, grid_.size() - first);
    uint64_t stored = 0;
    for (uint32_t c = 0; c < columns; ++c) {
      const Entry* slice = &slices[(first + c) * lobes];
      bool absent = true;
      for (size_t k = 0; k < lobes; ++k) absent &= slice[k] == absent_[0];
      stored |= uint64_t{!absent} << c;
    }
    words[first / kWordColumns] = rank << kWordColumns | stored;
    rank += static_cast<uint64_t>(std::popcount(stored));
  }
  auto* const entries = reinterpret_cast<Entry*>(memory_.Allocate(rank * lobes * sizeof(Entry)));
  Entry* out = entries;
  for (uint32_t w = 0; w < words_; ++w)
    for (uint64_t left = words[w] & ((uint64_t{1} << kWordColumns) - 1); left; left &= left - 1) {
      const auto column = w * kWordColumns + static_cast<uint32_t>(std::countr_zero(left));
      out = std::copy_n(&slices[column * lobes], lobes, out);
    }
  return entries;
}

// The same code twice: once for any x86-64, once where the processor counts bits and has wide registers; both
// round alike.
void LayerLight::Look(std::span<const LightQuery> queries, HitLight* out) const {
#if defined(__x86_64__)
  if (wide_) {
    LookWide(queries, out);
    return;
  }
#endif
  LookBatches(queries, out);
}

#if defined(__x86_64__)
__attribute__((target("avx2,bmi,bmi2,popcnt"), flatten)) void LayerLight::LookWide(
    std::span<const LightQuery> queries, HitLight* out) const {
  LookBatches(queries, out);
}
#endif

inline void LayerLight::LookBatches(std::span<const LightQuery> queries, HitLight* out) const {
  Pending pending[kBatch];
  bool reflects[kBatch];
  uint32_t hint = 0;
  for (size_t first = 0; first < queries.size(); first += kBatch) {
    const size_t count = std::min<size_t>(kBatch, queries.size() - first);
    const LightQuery* query = queries.data() + first;
    for (size_t i = 0; i < count; ++i) __builtin_prefetch(&triangles_[query[i].triangle]);
    for (size_t i = 0; i < count; ++i) {
      for (const uint32_t v : triangles_[query[i].triangle].vertex) __builtin_prefetch(&vertices_[v]);
      FindRows(query[i], &pending[i]);
    }
    for (size_t i = 0; i < count; ++i) {
      reflects[i] = Orient(query[i], &pending[i]);
      if (reflects[i]) Locate(query[i].wo, &hint, &pending[i]);
    }
    for (size_t i = 0; i < count; ++i)
      if (reflects[i]) FindEntries(&pending[i]);
    for (size_t i = 0; i < count; ++i) out[first + i] = reflects[i] ? Evaluate(pending[i]) : HitLight{};
  }
}

/// As TransferReader.
inline void LayerLight::FindRows(const LightQuery& query, Pending* hit) const {
  std::array<float, 3> weight = {1 - query.u - query.v, query.u, query.v};
  hit->barycentric = weight;
  if (!facet_rows_) {
    hit->rows = 3;
    for (size_t i = 0; i < 3; ++i) {
      hit->row[i] = triangles_[query.triangle].vertex[i];
      hit->row_weight[i] = weight[i];
    }
    return;
  }
  hit->rows = 0;
  float total = 0;
  for (const FacetRows::Row& row : facet_rows_->Locate(query.triangle, &weight)) {
    const float w = row.At(weight);
    if (w == 0) continue;
    __builtin_prefetch(&row_[row.row]);
    hit->row[hit->rows] = row.row;
    hit->row_weight[hit->rows++] = w;
    total += w;
  }
  if (total > 0 && total < 0.999f)
    for (int i = 0; i < hit->rows; ++i) hit->row_weight[i] /= total;
}

inline bool LayerLight::Orient(const LightQuery& query, Pending* hit) const {
  const Triangle& t = triangles_[query.triangle];
  glm::vec3 face = t.normal;
  const bool back = glm::dot(face, query.wo) < 0;
  if (back && !t.double_sided) return false;
  hit->triangle = &t;
  hit->side = back ? -1.0f : 1.0f;
  hit->wo = query.wo;
  face *= hit->side;
  if (face == glm::vec3(0)) face = query.wo;
  glm::vec3 n(0);
  for (int i = 0; i < 3; ++i) n += hit->barycentric[i] * vertices_[t.vertex[i]].row.normal;
  const float length2 = glm::dot(n, n);
  n = length2 > 1e-20f ? n * (hit->side / std::sqrt(length2)) : face;
  hit->normal = BendNormal(face, query.wo, n);
  hit->cos_o = std::max(glm::dot(hit->normal, query.wo), kMinCosine);
  return true;
}

/// The grid directions around wo and the corners' weights.
inline void LayerLight::Locate(const glm::vec3& wo, uint32_t* hint, Pending* hit) const {
  if (LocateAround(wo, hint, hit)) return;
  // As TransferReader: wo is under every corner's horizon, and the interpolated normal stands in.
  glm::vec3 n(0);
  for (int i = 0; i < hit->rows; ++i) n += hit->row_weight[i] * RowAt(hit->row[i]).normal;
  const float length2 = glm::dot(n, n);
  LocateAround(length2 > 1e-20f ? n * (hit->side / std::sqrt(length2)) : hit->normal, hint, hit);
}

/// The same for any direction; also fetches what tells where the entries are. False if no corner has a slice.
inline bool LayerLight::LocateAround(const glm::vec3& direction, uint32_t* hint, Pending* hit) const {
  const DirectionGrid::Location location = grid_.Locate(direction, hint);
  const DirectionGrid::Cell& cell = grid_.cell(*hint);
  const Float4 x = Load(cell.x), y = Load(cell.y), z = Load(cell.z);
  const Float4 share = {location.weight[0], location.weight[1], location.weight[2], 0};
  Float4 weight[kMaxPointRows], total = {};
  for (int i = 0; i < hit->rows; ++i) {
    const glm::vec3& n = RowAt(hit->row[i]).normal;
    const Float4 cosine = (n.x * hit->side) * x + (n.y * hit->side) * y + (n.z * hit->side) * z;
    weight[i] = cosine > 0.0f ? hit->row_weight[i] * share : Float4{};
    total += weight[i];
  }
  const float sum = total[0] + total[1] + total[2];
  const float scale = sum > 0 ? 1 / sum : 0;
  hit->defined = sum > 0;
  for (int i = 0; i < hit->rows; ++i) {
    const Float4 scaled = weight[i] * scale;
    std::memcpy(hit->weight[i].data(), &scaled, sizeof scaled);
  }
  for (int j = 0; j < 3; ++j) {
    hit->word[j] = location.index[j] / kWordColumns;
    hit->bit[j] = location.index[j] % kWordColumns;
    for (int i = 0; i < hit->rows; ++i) __builtin_prefetch(WordsOf(hit->row[i]) + hit->word[j]);
  }
  return hit->defined;
}

inline void LayerLight::FindEntries(Pending* hit) const {
  uint64_t stored = 0;
  for (int i = 0; i < hit->rows; ++i) {
    const Entry* entries = Entries(hit->row[i]);
    const uint64_t* words = WordsOf(hit->row[i]);
    for (int j = 0; j < 3; ++j) {
      const uint64_t word = words[hit->word[j]];
      const uint64_t below = word & ((uint64_t{1} << hit->bit[j]) - 1);
      const uint64_t rank = (word >> kWordColumns) + static_cast<uint64_t>(std::popcount(below));
      const Entry* entry = entries + rank * static_cast<uint64_t>(lobes_);
      const uint64_t here = word >> hit->bit[j] & 1;
      stored |= here;
      entry = here ? entry : absent_.data();
      __builtin_prefetch(entry);
      hit->entry[3 * i + j] = entry;
    }
  }
  hit->stored = stored;
}

inline HitLight LayerLight::Evaluate(const Pending& hit) const {
  HitLight out;
  const auto& v = hit.triangle->vertex;
  const Vertex* vertex[3] = {&vertices_[v[0]], &vertices_[v[1]], &vertices_[v[2]]};
  glm::vec3 specular(0), diffuse(0);
  for (int i = 0; i < 3; ++i) {
    specular += hit.barycentric[i] * vertex[i]->specular;
    diffuse += hit.barycentric[i] * vertex[i]->diffuse;
  }
  // Between unlike shapes (textured roughness) the nearest corner's serves.
  int nearest = 0;
  if (!hit.triangle->one_shape)
    for (int i = 1; i < 3; ++i)
      if (hit.barycentric[i] > hit.barycentric[nearest]) nearest = i;
  const SliceSampler& sampler = samplers_[vertex[nearest]->shape];

  if (layer_ == 0 || hit.stored) AddSpecular(hit, sampler, specular, &out);
  if (diffuse_.empty() || diffuse.x + diffuse.y + diffuse.z <= 0) return out;
  const glm::vec3 albedo = DiffuseAlbedo({sampler.model(), sampler.shape(), specular, diffuse}, hit.cos_o);
  Sums sums;
  for (int i = 0; i < hit.rows; ++i)
    sums.Add(hit.row_weight[i], diffuse_[2 * size_t{hit.row[i]} + (hit.side < 0)]);
  if (hit.rows == 0) sums.Add(1, absent_[0]);
  if (layer_ == 0) {
    AddDirect(sums, albedo, hit.normal, kCosineKappa, &out);
  } else {
    AddIndirect(sums, albedo, &out);
  }
  return out;
}

inline void LayerLight::AddSpecular(const Pending& hit, const SliceSampler& sampler,
                                    const glm::vec3& specular, HitLight* out) const {
  BrdfSlice slice;
  std::array<glm::vec3, 2> axes;
  if (layer_ == 0) {
    slice = sampler.Seen(hit.cos_o);
    axes = IncidenceAxes(hit.normal, hit.wo);
  } else {
    sampler.Weights(hit.cos_o, &slice);
  }
  for (int k = 0; k < slice.lobes; ++k) {
    Sums sums;
    for (int i = 0; i < hit.rows; ++i)
      for (int j = 0; j < 3; ++j) sums.Add(hit.weight[i][j], hit.entry[3 * i + j][k]);
    if (!hit.defined) sums.Add(1, absent_[0]);
    const BrdfLobe& lobe = slice.lobe[k];
    if (layer_ == 0) {
      AddDirect(sums, lobe.Weight(specular), axes[0] * lobe.mu_x + axes[1] * lobe.mu_z, lobe.kappa, out);
    } else {
      AddIndirect(sums, lobe.Weight(specular), out);
    }
  }
}

inline void LayerLight::AddDirect(const Sums& sums, const glm::vec3& weight, const glm::vec3& mu, float kappa,
                                  HitLight* out) const {
  const float fraction = std::min(sums.linear[0], 1.0f);
  if (fraction <= 0) return;
  const float ratio = sums.linear[1] / sums.linear[0];
  const glm::vec3 alpha = weight * fraction;
  const glm::vec3 turned = mu + 2 / sums.linear[0] * sums.direction();
  const float length = glm::length(turned);
  const float strength = Luminance(alpha) * MeanCosine(std::min(kappa * ratio, kMaxKappa));
  out->alpha += alpha;
  out->moment += length > 1e-10f ? turned * (strength / length) : mu * strength;
}

inline void LayerLight::AddIndirect(const Sums& sums, const glm::vec3& weight, HitLight* out) const {
  const float strength = sums.strength;
  if (strength <= 0) return;
  const float spread = std::min(sums.linear[3] * (1 / kDeltaScale), strength);
  const glm::vec3 alpha = sums.rgb() * weight, direction = sums.direction();
  // 1 - |mean of mu| is the corners' mean 1 - cos from their common direction. Like corners are one lobe with
  // their mean width; unlike ones each keep their own place.
  const float length = glm::length(direction);
  const bool alike = strength - length <= kAlike * spread && length > 0;
  out->alpha += alpha;
  out->moment += direction * (Luminance(alpha) * (1 - spread / strength) / (alike ? length : strength));
}

}  // namespace glint
