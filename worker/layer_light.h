#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/base/slabs.h"
#include "common/domain/bake_domain.h"
#include "common/domain/direction_grid.h"
#include "common/domain/facet_rows.h"
#include "common/lobes/slice_sampler.h"
#include "common/lobes/vmf.h"

namespace glint {

/// Where a ray met a surface, and the unit direction back along it (world).
struct LightQuery {
  uint32_t triangle;
  float u, v;
  glm::vec3 wo;
};

/// Zeroth and first moment of the light that one layer sends from a surface point towards wo: alpha (RGB),
/// and the sum of luminance(alpha) ||r|| mu; zeros where nothing is reflected. Merging over hits is adding
/// these (laurijssen2011 Eq. 10, 11 without the divisions).
struct HitLight {
  glm::vec3 alpha{0}, moment{0};
};

/// One layer's tables packed for look-ups at hits, of which a bake makes hundreds of millions. It answers
/// what TransferReader answers (interpolation over bake vertices and three directions, Eq. 7), but only in
/// moments: corners that are too far apart to be averaged are each kept, not grouped. Entries are decoded
/// once into sixteen bytes that add up with two multiply-adds, all lobes of a (vertex, direction) side by
/// side, those that nested tables leave out as well; look-ups run in batches whose stages prefetch what the
/// next will read. Memory: 16 bytes a stored slice, with row sums of those vertices only that look-ups have
/// reached; and 8 bytes for each 48 directions of every bake vertex. Thread-safe.
class LayerLight {
 public:
  /// @param row_sums  as Gatherer::BeginLayer
  LayerLight(const BakeDomain& domain, const DirectionGrid& grid, const LayerViews& views, int layer,
             int threads, std::span<const uint64_t> row_sums = {});

  /// out[i] answers queries[i]. Queries in a row that are near each other go faster; the answers do not
  /// depend on that.
  void Look(std::span<const LightQuery> queries, HitLight* out) const;
  /// kBadInput: answers are wrong, as a row differs from its sum.
  Status status() const;

 private:
  static constexpr int kBatch = 32;
  static constexpr uint32_t kWordColumns = 48;  ///< a row's word: 48 columns' bits, and 16 bits of rank

  /// One lobe as two times four terms: what is linear in the corner's weight, and a vector that also carries
  /// the strength beside it.
  ///   direct:   halves f, f kappa_ratio, 0, 0;  signed shift / 2 and half f
  ///   indirect: halves alpha r, g, b, s delta 2^10;  signed mu and half s
  /// with s = luminance(alpha) and delta = 1 - r(kappa).
  struct alignas(16) Entry {
    std::array<uint16_t, 4> linear;
    std::array<int16_t, 3> vector;
    uint16_t strength;
    bool operator==(const Entry& o) const {  // of some hundred million: without calls
      return std::bit_cast<std::array<uint64_t, 2>>(*this) == std::bit_cast<std::array<uint64_t, 2>>(o);
    }
  };
  struct alignas(32) Triangle {
    std::array<uint32_t, 3> vertex;
    glm::vec3 normal;  ///< unit, geometric
    uint32_t double_sided;
    uint32_t one_shape;
  };
  struct Row {
    glm::vec3 normal;
    const Entry* entries;  ///< null: no look-up has reached it
  };
  struct alignas(64) Vertex {
    Row row;  ///< its own, where every vertex is baked; else the normal alone
    glm::vec3 specular, diffuse;
    uint32_t shape;
  };
  struct Pending;
  struct Sums;

  void PackSurface();
  void PackRows(int threads);
  void PackRowOf(uint32_t v) const;
  const Entry* Reach(uint32_t v) const;
  void UnpackRow(const LayerViews& views, uint32_t v, std::vector<Entry>* slices) const;
  void PredictSlices(const SliceTableView::RowView& row, uint32_t slot, uint32_t v,
                     std::vector<Entry>* slices) const;
  static Entry Mean(const Entry& a, const Entry& b);
  const Entry* PackRow(const std::vector<Entry>& slices, uint64_t* words) const;
  Vmf Whole(uint32_t slot, uint32_t v, uint32_t column) const;
  /// A slice as one entry, however many lobes it has.
  /// @param stored  the first of them
  Entry Pack(const LayerViews& views, uint32_t slot, uint32_t v, uint32_t column,
             const std::byte* stored) const;
  void LookWide(std::span<const LightQuery> queries, HitLight* out) const;
  void LookBatches(std::span<const LightQuery> queries, HitLight* out) const;
  Row& RowAt(uint32_t r) const { return facet_rows_ ? row_[r] : vertices_[r].row; }
  uint64_t* WordsOf(uint32_t r) const { return row_words_ + size_t{r} * words_; }
  void Publish(uint32_t v, const Entry* entries) const;
  void PublishEmpty(uint32_t v) const;
  const Entry* Entries(uint32_t v) const;
  void FindRows(const LightQuery& query, Pending* hit) const;
  bool Orient(const LightQuery& query, Pending* hit) const;
  void Locate(const glm::vec3& wo, uint32_t* hint, Pending* hit) const;
  bool LocateAround(const glm::vec3& direction, uint32_t* hint, Pending* hit) const;
  void FindEntries(Pending* hit) const;
  HitLight Evaluate(const Pending& hit) const;
  void AddSpecular(const Pending& hit, const SliceSampler& sampler, const glm::vec3& specular,
                   HitLight* out) const;
  void AddDirect(const Sums& sums, const glm::vec3& weight, const glm::vec3& mu, float kappa,
                 HitLight* out) const;
  void AddIndirect(const Sums& sums, const glm::vec3& weight, HitLight* out) const;

  const BakeDomain& domain_;
  const DirectionGrid& grid_;
  std::optional<FacetRows> facet_rows_;  ///< none: every vertex is baked, and nothing else
  const int layer_;
  const int lobes_;
  const uint32_t words_;  ///< of a row
  bool wide_ = false;     ///< this processor has AVX2 and counts bits
  std::vector<SliceSampler> samplers_;
  std::vector<Triangle> triangles_;
  // What follows grows as rows are reached; nothing of a row changes once its entries can be seen.
  mutable std::vector<Vertex> vertices_;
  mutable std::vector<Row> row_;  ///< with facet_rows_
  std::vector<Entry> absent_;     ///< as many as lobes: what a direction without an entry stands for
  mutable Slabs memory_;
  /// [words_ * row]. All rows' side by side: each look-up reads some of three rows', and there must be few
  /// pages of them.
  uint64_t* row_words_;
  mutable std::vector<Entry> diffuse_;  ///< [2 row + side]; empty if nothing is diffuse
  const LayerViews views_;              ///< of use without row sums in the constructor alone
  // With row sums:
  static constexpr uint32_t kNoRow = UINT32_MAX;
  const std::span<const uint64_t> row_sums_;
  mutable std::array<std::mutex, 64> reaching_;
  mutable std::atomic<uint32_t> damaged_row_{kNoRow};
};

}  // namespace glint
