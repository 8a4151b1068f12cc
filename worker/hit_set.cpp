#include "worker/hit_set.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/rng.h"

namespace glint {
namespace {

using Outcome = HitSet::Outcome;

/// Side of the lattice that serves a shape: rays_per_kappa rays per unit of its sharpest kappa, within the
/// bounds.
int LatticeSide(const BrdfShape& shape, const BakeSettings& settings) {
  float kappa = 1;
  for (const BrdfSlice& slice : shape.slices)
    for (int k = 0; k < slice.lobes; ++k)
      if (slice.lobe[k].scale + slice.lobe[k].bias > 0.02f) kappa = std::max(kappa, slice.lobe[k].kappa);
  const float rays = std::clamp(settings.rays_per_kappa * kappa, static_cast<float>(settings.min_rays),
                                static_cast<float>(settings.max_rays));
  return std::max(1, static_cast<int>(std::lround(std::sqrt(rays) / 4))) * 4;
}

SurfaceHit Quantize(const Hit& hit) {
  return {hit.triangle, static_cast<uint16_t>(std::lround(std::clamp(hit.u, 0.0f, 1.0f) * 65535)),
          static_cast<uint16_t>(std::lround(std::clamp(hit.v, 0.0f, 1.0f) * 65535))};
}

/// One side of one vertex being traced.
class Fan {
 public:
  Fan(const GatherInput& input, const SurfaceVertices& surface, const VertexSide& side, uint32_t vertex,
      const Frame& frame)
      : input_(input), surface_(surface), side_(side), vertex_(vertex), frame_(frame) {}

  void TraceCells(const HemisphereLattice& lattice) {
    rays_.resize(lattice.cells());
    hits_.resize(lattice.cells());
    for (int c = 0; c < lattice.cells(); ++c) rays_[c] = MakeRay(lattice.direction(c));
    input_.rays.IntersectCoherent(rays_.data(), hits_.data(), lattice.cells());
    outcomes_.resize(lattice.cells());
    for (int c = 0; c < lattice.cells(); ++c) outcomes_[c] = Classify(rays_[c].direction, hits_[c]);
  }

  /// Cells whose right or lower neighbour sees something else, and those neighbours.
  std::vector<int> CellsToSplit(const HemisphereLattice& lattice) const {
    std::vector<uint8_t> split(lattice.cells(), 0);
    for (int c = 0; c < lattice.cells(); ++c)
      for (const int other : {lattice.right(c), lattice.below(c)})
        if (other >= 0 && Differ(c, other)) split[c] = split[other] = 1;
    std::vector<int> cells;
    for (int c = 0; c < lattice.cells(); ++c)
      if (split[c] && outcomes_[c] != Outcome::kInvalid) cells.push_back(c);
    return cells;
  }

  void TraceQuarters(const HemisphereLattice& lattice, const std::vector<int>& cells,
                     std::vector<Outcome>* outcomes, std::vector<Hit>* hits) {
    const size_t count = cells.size() * 4;
    quarter_rays_.resize(count);
    hits->resize(count);
    outcomes->resize(count);
    for (size_t i = 0; i < count; ++i)
      quarter_rays_[i] = MakeRay(lattice.quarter(cells[i / 4], static_cast<int>(i % 4)));
    input_.rays.IntersectCoherent(quarter_rays_.data(), hits->data(), static_cast<int>(count));
    for (size_t i = 0; i < count; ++i) (*outcomes)[i] = Classify(quarter_rays_[i].direction, (*hits)[i]);
  }

  const std::vector<Outcome>& outcomes() const { return outcomes_; }
  const std::vector<Hit>& hits() const { return hits_; }

 private:
  Ray MakeRay(const glm::vec3& local) const {
    Ray ray;
    ray.origin = side_.origin;
    ray.direction = frame_.ToWorld(local);
    return ray;
  }

  /// Directions under the faces around the vertex do not leave the surface: neither free nor blocked. The
  /// lobe's weight is shared out among the directions that do, as when a normal is bent towards its face.
  Outcome Classify(const glm::vec3& direction, const Hit& hit) const {
    if (glm::dot(direction, side_.geometric) <= 0) return Outcome::kInvalid;
    if (!hit.hit()) return Outcome::kFree;
    if (hit.t < surface_.touch_distance(vertex_) && surface_.Incident(hit.triangle, vertex_))
      return Outcome::kInvalid;
    return Outcome::kHit;
  }

  glm::vec3 FaceNormal(uint32_t triangle) const {
    const auto& t = input_.domain.triangles[triangle];
    const glm::vec3& p = input_.domain.positions[t[0]];
    return glm::cross(input_.domain.positions[t[1]] - p, input_.domain.positions[t[2]] - p);
  }

  bool Differ(int a, int b) const {
    constexpr float kDepthRatio = 1.5f, kNormalCosine = 0.3f;
    if (outcomes_[a] != outcomes_[b]) return true;
    if (outcomes_[a] != Outcome::kHit || hits_[a].triangle == hits_[b].triangle) return false;
    const auto [near, far] = std::minmax(hits_[a].t, hits_[b].t);
    if (far > kDepthRatio * near) return true;
    const glm::vec3 na = FaceNormal(hits_[a].triangle), nb = FaceNormal(hits_[b].triangle);
    return glm::dot(na, nb) < kNormalCosine * std::sqrt(glm::dot(na, na) * glm::dot(nb, nb));
  }

  const GatherInput& input_;
  const SurfaceVertices& surface_;
  const VertexSide side_;
  const uint32_t vertex_;
  const Frame frame_;
  std::vector<Ray> rays_, quarter_rays_;
  std::vector<Hit> hits_;
  std::vector<Outcome> outcomes_;
};

}  // namespace

void HemisphereSamples::ConeArrays::Clear() {
  for (auto* a : {&x, &y, &z, &cos_radius, &sin_radius}) a->clear();
}

void HemisphereSamples::ConeArrays::Add(const HemisphereLattice::Cone& cone) {
  x.push_back(cone.axis.x);
  y.push_back(cone.axis.y);
  z.push_back(cone.axis.z);
  cos_radius.push_back(cone.cos_radius);
  sin_radius.push_back(cone.sin_radius);
}

TileCones HemisphereSamples::ConeArrays::Pad() {
  while (x.size() % kLanes != 0) Add({{0, 0, 1}, -4, 0});
  return {x.data(), y.data(), z.data(), cos_radius.data(), sin_radius.data(), static_cast<int>(x.size())};
}

inline void HemisphereSamples::AddSample(const glm::vec3& direction, float solid_angle, Outcome outcome) {
  if (outcome == Outcome::kInvalid) return;
  if (outcome == Outcome::kHit) hit_sample_.push_back(count_);
  x_[count_] = direction.x;
  y_[count_] = direction.y;
  z_[count_] = direction.z;
  solid_angle_[count_] = solid_angle;
  blocked_[count_] = outcome == Outcome::kHit ? 1.0f : 0.0f;
  ++count_;
}

void HemisphereSamples::Expand(const HitSet& hits, const HemisphereLattice& lattice) {
  tiles_ = lattice.tiles();
  const size_t room = hits.outcome.size() + static_cast<size_t>(tiles_) * kLanes;
  for (auto* a : {&x_, &y_, &z_, &solid_angle_, &blocked_})
    if (a->size() < room) a->resize(room);
  count_ = 0;
  tile_begin_.clear();
  tile_blocked_.clear();
  hit_sample_.clear();
  cone_arrays_.Clear();
  blocked_cone_arrays_.Clear();
  const float solid_angle = lattice.solid_angle();
  const Outcome* outcome = hits.outcome.data();
  const Outcome* quarter = outcome + lattice.cells();
  for (int tile = 0; tile < tiles_; ++tile) {
    tile_begin_.push_back(count_);
    const size_t hits_before = hit_sample_.size();
    const int first_cell = tile * HemisphereLattice::kTileCells;
    for (int c = first_cell; c < first_cell + HemisphereLattice::kTileCells; ++c) {
      if (outcome[c] != Outcome::kSplit) {
        AddSample(lattice.direction(c), solid_angle, outcome[c]);
        continue;
      }
      for (int q = 0; q < 4; ++q) AddSample(lattice.quarter(c, q), 0.25f * solid_angle, *quarter++);
    }
    while (count_ % kLanes != 0) AddSample({0, 0, 1}, 0, Outcome::kFree);
    const bool blocked = hit_sample_.size() > hits_before;
    tile_blocked_.push_back(blocked);
    cone_arrays_.Add(lattice.tile_cone(tile));
    if (blocked) blocked_cone_arrays_.Add(lattice.tile_cone(tile));
  }
  tile_begin_.push_back(count_);
  cones_ = cone_arrays_.Pad();
  blocked_cones_ = blocked_cone_arrays_.Pad();
}

void HemisphereSamples::Shade(const HitSet& hits, const Frame& frame, const LayerLight& light) {
  const size_t count = hits.hits.size();
  queries_.resize(count);
  answers_.resize(count);
  for (size_t h = 0; h < count; ++h) {
    const SurfaceHit& hit = hits.hits[h];
    const uint32_t i = hit_sample_[h];
    queries_[h] = {hit.triangle, static_cast<float>(hit.u) * (1 / 65535.0f),
                   static_cast<float>(hit.v) * (1 / 65535.0f), -frame.ToWorld({x_[i], y_[i], z_[i]})};
  }
  light.Look(queries_, answers_.data());
  for (auto& channel : light_) channel.assign(count_, 0.0f);
  for (size_t h = 0; h < count; ++h) {
    const uint32_t i = hit_sample_[h];
    for (int c = 0; c < 3; ++c) {
      light_[c][i] = answers_[h].alpha[c];
      light_[3 + c][i] = answers_[h].moment[c];
    }
  }
}

SampleArrays HemisphereSamples::arrays() const {
  return {x_.data(),
          y_.data(),
          z_.data(),
          solid_angle_.data(),
          blocked_.data(),
          {light_[0].data(), light_[1].data(), light_[2].data(), light_[3].data(), light_[4].data(),
           light_[5].data()},
          tile_begin_.data(),
          tile_blocked_.data()};
}

HitSetCache::HitSetCache(const GatherInput& input, const BakeSettings& settings, uint64_t memory_bytes)
    : input_(input),
      settings_(settings),
      surface_(input.domain, input.rays.epsilon()),
      sets_(2 * static_cast<size_t>(input.domain.vertex_count())),
      room_(static_cast<int64_t>(memory_bytes)) {
  for (const BrdfShape& shape : input.domain.shapes) {
    const int side = LatticeSide(shape, settings);
    size_t i = 0;
    while (i < lattices_.size() && lattices_[i]->side() != side) ++i;
    if (i == lattices_.size()) lattices_.push_back(std::make_unique<HemisphereLattice>(side));
    lattice_of_shape_.push_back(static_cast<uint8_t>(i));
  }
}

HitSetCache::~HitSetCache() {
  for (auto& set : sets_) delete set.load();
}

const HemisphereLattice& HitSetCache::lattice(uint32_t vertex) const {
  return *lattices_[lattice_of_shape_[input_.domain.shape[vertex]]];
}

Frame HitSetCache::LatticeFrame(uint32_t vertex, bool back) const {
  const Frame base = Frame::FromNormal(surface_.side(vertex, back).normal);
  const float angle = 2 * kPi * CounterRng(settings_.seed, vertex, back, 0x4C617474u).Uniform();
  const float c = std::cos(angle), s = std::sin(angle);
  return {c * base.t + s * base.b, c * base.b - s * base.t, base.n};
}

std::unique_ptr<HitSet> HitSetCache::Trace(uint32_t vertex, bool back) const {
  const HemisphereLattice& lattice = this->lattice(vertex);
  Fan fan(input_, surface_, surface_.side(vertex, back), vertex, LatticeFrame(vertex, back));
  fan.TraceCells(lattice);
  const std::vector<int> split = settings_.split_cells ? fan.CellsToSplit(lattice) : std::vector<int>();
  std::vector<Outcome> quarter_outcomes;
  std::vector<Hit> quarter_hits;
  fan.TraceQuarters(lattice, split, &quarter_outcomes, &quarter_hits);

  auto set = std::make_unique<HitSet>();
  set->lattice_side = lattice.side();
  set->rays = static_cast<uint64_t>(lattice.cells()) + quarter_hits.size();
  set->outcome = fan.outcomes();
  for (const int c : split) set->outcome[c] = Outcome::kSplit;
  size_t quarter = 0;
  for (int c = 0; c < lattice.cells(); ++c) {
    if (set->outcome[c] == Outcome::kHit) set->hits.push_back(Quantize(fan.hits()[c]));
    if (set->outcome[c] != Outcome::kSplit) continue;
    for (int q = 0; q < 4; ++q, ++quarter)
      if (quarter_outcomes[quarter] == Outcome::kHit) set->hits.push_back(Quantize(quarter_hits[quarter]));
  }
  set->outcome.insert(set->outcome.end(), quarter_outcomes.begin(), quarter_outcomes.end());
  set->outcome.shrink_to_fit();
  set->hits.shrink_to_fit();
  return set;
}

const HitSet& HitSetCache::Get(uint32_t vertex, bool back, std::unique_ptr<HitSet>* keep) {
  std::atomic<HitSet*>& slot = sets_[2 * static_cast<size_t>(vertex) + back];
  if (const HitSet* known = slot.load(std::memory_order_acquire)) return *known;
  *keep = Trace(vertex, back);
  const auto bytes = static_cast<int64_t>((*keep)->bytes());
  if (room_.fetch_sub(bytes) < bytes) {
    room_.fetch_add(bytes);
    return **keep;
  }
  HitSet* expected = nullptr;
  if (!slot.compare_exchange_strong(expected, keep->get(), std::memory_order_acq_rel)) {
    room_.fetch_add(bytes);  // another thread was first, with the same set
    return *expected;
  }
  return *keep->release();
}

}  // namespace glint
