#include "worker/hit_set.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "common/base/rng.h"

namespace glint {
namespace {

SurfaceHit Quantize(const Hit& hit) {
  return {hit.triangle, static_cast<uint16_t>(std::clamp(hit.u, 0.0f, 1.0f) * 65535 + 0.5f),
          static_cast<uint16_t>(std::clamp(hit.v, 0.0f, 1.0f) * 65535 + 0.5f)};
}

/// A ray through a sample, or through the middle of it and one `partner` places on, for both.
struct FanRay {
  int sample;
  int partner;  ///< 0: none
};

/// The samples of one level that a split parent has, or all cells.
struct FanLevel {
  std::vector<int> index;  ///< in the lattice, ascending
  std::vector<FanRay> rays;
  std::vector<uint8_t>
      ray;  ///< of each: 1 + the quarter of its parent that its ray is first for; 0: its parent's
  std::vector<uint8_t> outcome;
  std::vector<Hit> hits;

  void Clear() {
    index.clear();
    rays.clear();
    ray.clear();
    outcome.clear();
    hits.clear();
  }
};

/// Buffers of one thread: a fan takes some 100 us, of which allocating would be a good part.
struct FanBuffers {
  std::array<FanLevel, HemisphereLattice::kLevels> levels;
  std::vector<Ray> rays;
  std::vector<Hit> found;
  std::vector<uint8_t> map, coarse_map;
  std::vector<glm::vec3> normals;
};

/// One side of one vertex being traced: every cell; then, where a neighbour across a side sees another
/// outcome, or a face at quite another angle, the quarters on that side, while the others keep what their
/// cell saw; and theirs again where the outcome differs. Where neighbours in one direction only differ, two
/// quarters along the border share a ray: across it, where it matters, that tells as much.
class Fan {
 public:
  Fan(const GatherInput& input, const SurfaceVertices& surface, const VertexSide& side, uint32_t vertex,
      const Frame& frame, const HemisphereLattice& lattice, FanBuffers* buffers)
      : input_(input),
        surface_(surface),
        side_(side),
        vertex_(vertex),
        frame_(frame),
        lattice_(lattice),
        buffers_(*buffers) {}

  void Trace(int split_levels) {
    for (FanLevel& level : buffers_.levels) level.Clear();
    FanLevel& cells = buffers_.levels[0];
    cells.index.resize(lattice_.cells());
    std::iota(cells.index.begin(), cells.index.end(), 0);
    for (const int i : cells.index) cells.rays.push_back({i, 0});
    cells.hits.resize(cells.index.size());
    cells.outcome.resize(cells.index.size());
    TraceLevel(0);
    for (int level = 0; level < split_levels; ++level) {
      Split(level);
      TraceLevel(level + 1);
    }
  }

  /// Valid until the buffers serve the next fan.
  const FanLevel& level(int i) const { return buffers_.levels[i]; }

 private:
  static constexpr uint8_t kOutside = 255;
  /// Eight rays in a row of a lattice this fine stay together long enough for coherent packets to win.
  static constexpr int kCoherentCells = 900;
  /// Cells whose faces turn by more (30 degrees) see a mirror image change too fast for one look.
  static constexpr float kLikeNormals = 0.85f;

  void TraceLevel(int level) {
    FanLevel& l = buffers_.levels[level];
    const size_t count = l.rays.size();
    std::vector<Ray>& rays = buffers_.rays;
    std::vector<Hit>& found = buffers_.found;
    rays.resize(count);
    found.resize(count);
    for (size_t i = 0; i < count; ++i) {
      rays[i].origin = side_.origin;
      rays[i].direction = frame_.ToWorld(Direction(level, l.rays[i]));
    }
    if (lattice_.cells() < kCoherentCells) {
      input_.rays.Intersect(rays.data(), found.data(), static_cast<int>(count));
    } else {
      input_.rays.IntersectCoherent(rays.data(), found.data(), static_cast<int>(count));
    }
    for (size_t i = 0; i < count; ++i) {
      const auto [sample, partner] = l.rays[i];
      l.hits[sample] = l.hits[sample + partner] = found[i];
      l.outcome[sample] = l.outcome[sample + partner] = Classify(rays[i].direction, found[i]);
    }
  }

  glm::vec3 Direction(int level, const FanRay& ray) const {
    const std::vector<int>& index = buffers_.levels[level].index;
    const glm::vec3& direction = lattice_.direction(level, index[ray.sample]);
    if (ray.partner == 0) return direction;
    return glm::normalize(direction + lattice_.direction(level, index[ray.sample + ray.partner]));
  }

  /// Marks the level's samples that a neighbour differs from, and lists their quarters.
  void Split(int level) {
    // What is seen over the square, with a border that differs from nothing.
    const int side = lattice_.side() << level, stride = side + 2;
    std::vector<uint8_t>& map = buffers_.map;
    std::swap(map, buffers_.coarse_map);
    map.assign(static_cast<size_t>(stride) * stride, kOutside);
    auto at = [&](int x, int y) -> uint8_t& { return map[static_cast<size_t>(y + 1) * stride + x + 1]; };
    FanLevel& l = buffers_.levels[level];
    if (level > 0)  // what is seen where the level has no samples
      for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
          at(x, y) = buffers_.coarse_map[static_cast<size_t>(y / 2 + 1) * (side / 2 + 2) + x / 2 + 1];
    for (size_t i = 0; i < l.index.size(); ++i) {
      const auto& [x, y] = lattice_.place(level, l.index[i]);
      at(x, y) = l.outcome[i];
    }
    if (level == 0) MapNormals(stride);
    FanLevel& next = buffers_.levels[level + 1];
    for (size_t i = 0; i < l.index.size(); ++i) {
      const uint8_t mine = l.outcome[i];
      if (mine == HitSet::kInvalid) continue;
      const auto& [x, y] = lattice_.place(level, l.index[i]);
      auto differs = [&, x = x, y = y](int dx, int dy) {
        const uint8_t other = at(x + dx, y + dy);
        if (other != mine) return other != kOutside;
        if (level > 0 || mine != HitSet::kHit) return false;
        const glm::vec3* normal = &buffers_.normals[static_cast<size_t>(y + 1) * stride + x + 1];
        return glm::dot(*normal, normal[dy * stride + dx]) < kLikeNormals;
      };
      const bool across_x[2] = {differs(-1, 0), differs(1, 0)};
      const bool across_y[2] = {differs(0, -1), differs(0, 1)};
      if (!(across_x[0] || across_x[1] || across_y[0] || across_y[1])) continue;
      l.outcome[i] = HitSet::kSplit;
      const int partner = !(across_y[0] || across_y[1]) ? 2 : !(across_x[0] || across_x[1]) ? 1 : 0;
      for (int q = 0; q < 4; ++q) {
        const bool own = across_x[q & 1] || across_y[q >> 1];
        const int first = q & partner ? q - partner : q;
        if (own && first == q) next.rays.push_back({static_cast<int>(next.index.size()), partner});
        next.ray.push_back(static_cast<uint8_t>(own ? 1 + first : 0));
        next.index.push_back(4 * l.index[i] + q);
        next.outcome.push_back(mine);
        next.hits.push_back(l.hits[i]);
      }
    }
  }

  /// Unit normals of the faces that cells met, laid out as the map.
  void MapNormals(int stride) {
    const FanLevel& cells = buffers_.levels[0];
    buffers_.normals.resize(static_cast<size_t>(stride) * stride);
    for (size_t i = 0; i < cells.index.size(); ++i) {
      if (cells.outcome[i] != HitSet::kHit) continue;
      const auto& [x, y] = lattice_.place(0, cells.index[i]);
      buffers_.normals[static_cast<size_t>(y + 1) * stride + x + 1] =
          surface_.face_normal(cells.hits[i].triangle);
    }
  }

  uint8_t Classify(const glm::vec3& direction, const Hit& hit) const {
    if (!surface_.Leaves(vertex_, side_, direction, hit)) return HitSet::kInvalid;
    return hit.hit() ? HitSet::kHit : HitSet::kFree;
  }

  const GatherInput& input_;
  const SurfaceVertices& surface_;
  const VertexSide side_;
  const uint32_t vertex_;
  const Frame frame_;
  const HemisphereLattice& lattice_;
  FanBuffers& buffers_;
};

/// Puts a fan's levels together.
class HitSetBuilder {
 public:
  explicit HitSetBuilder(const Fan& fan) : fan_(fan) {}

  HitSet Build() {
    const FanLevel &cells = fan_.level(0), &quarters = fan_.level(1);
    set_.cells = static_cast<uint32_t>(cells.outcome.size());
    set_.outcome.reserve(cells.outcome.size() + quarters.outcome.size());
    set_.outcome = cells.outcome;
    size_t quarter = 0;
    for (size_t c = 0; c < cells.outcome.size(); ++c) {
      if (cells.outcome[c] == HitSet::kHit) set_.hits.push_back(Quantize(cells.hits[c]));
      if (cells.outcome[c] != HitSet::kSplit) continue;
      AddQuarters(quarters, quarter);
      quarter += 4;
    }
    for (int level = 0; level < HemisphereLattice::kLevels; ++level)
      set_.rays += fan_.level(level).rays.size();
    set_.hits.shrink_to_fit();
    return std::move(set_);
  }

 private:
  void AddQuarters(const FanLevel& quarters, size_t first) {
    const size_t begin = set_.outcome.size();
    for (size_t i = first; i < first + 4; ++i) {
      // A pair's second has what the first has, and adds nothing.
      const int pair = PairedBefore(quarters, first, i);
      if (pair == 0) {
        AddQuarter(quarters, i);
        continue;
      }
      uint8_t& before = set_.outcome[begin + (i - first) - static_cast<size_t>(pair)];
      before = static_cast<uint8_t>(HitSet::kPair + (pair == 2 ? 2 : 0) + (before == HitSet::kHit));
      set_.outcome.push_back(HitSet::kInvalid);
    }
  }

  /// 1 or 2 places before quarter i, in its cell: a quarter that has the same ray; 0 if there is none.
  static int PairedBefore(const FanLevel& quarters, size_t first, size_t i) {
    const uint8_t outcome = quarters.outcome[i];
    if (outcome != HitSet::kFree && outcome != HitSet::kHit) return 0;
    for (size_t back = 1; back <= std::min<size_t>(2, i - first); ++back)
      if (quarters.ray[i - back] == quarters.ray[i] && quarters.outcome[i - back] == outcome)
        return static_cast<int>(back);
    return 0;
  }

  void AddQuarter(const FanLevel& quarters, size_t i) {
    uint8_t outcome = quarters.outcome[i];
    if (outcome == HitSet::kHit) set_.hits.push_back(Quantize(quarters.hits[i]));
    if (outcome == HitSet::kSplit) outcome = Partial();
    set_.outcome.push_back(outcome);
  }

  /// The next four rays of the finest level; the light that they meet is taken from one of them.
  uint8_t Partial() {
    const FanLevel& finest = fan_.level(2);
    int leaving = 0, blocked = 0;
    for (int q = 0; q < 4; ++q, ++next_finest_) {
      leaving += finest.outcome[next_finest_] != HitSet::kInvalid;
      if (finest.outcome[next_finest_] != HitSet::kHit) continue;
      if (blocked++ == 0) set_.hits.push_back(Quantize(finest.hits[next_finest_]));
    }
    if (leaving == 0) return HitSet::kInvalid;
    return static_cast<uint8_t>(HitSet::kPartial + 4 * blocked + leaving - 1);
  }

  const Fan& fan_;
  HitSet set_;
  size_t next_finest_ = 0;
};

}  // namespace

float SharpestKappa(const BrdfShape& shape) {
  float kappa = 1;
  for (const BrdfSlice& slice : shape.slices)
    for (int k = 0; k < slice.lobes; ++k)
      if (slice.lobe[k].scale + slice.lobe[k].bias > 0.02f) kappa = std::max(kappa, slice.lobe[k].kappa);
  return kappa;
}

// Rays for the sharpest lobe, within the bounds. The sharper a lobe, the less there is within it to tell
// apart, so rays grow as kappa^(3/4) only: at equal rays per kappa the indirect layers' error fell from
// exponent 128 to 512 by half.
int LatticeSide(const BrdfShape& shape, const BakeSettings& settings) {
  const float kappa = SharpestKappa(shape);
  constexpr float kReference = 128;
  const float wanted = settings.rays_per_kappa * kappa * std::pow(kReference / kappa, 0.25f);
  const float rays =
      std::clamp(wanted, static_cast<float>(settings.min_rays), static_cast<float>(settings.max_rays));
  return std::max(1, static_cast<int>(std::lround(std::sqrt(rays) / 4))) * 4;
}

HitSetCache::HitSetCache(const GatherInput& input, const BakeSettings& settings, uint64_t memory_bytes)
    : input_(input),
      settings_(settings),
      surface_(input.domain, input.rays.epsilon()),
      sets_(2 * static_cast<size_t>(input.domain.row_count())),
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
  return *lattices_[lattice_of_shape_[input_.domain.Row(vertex).shape]];
}

Frame HitSetCache::LatticeFrame(uint32_t vertex, bool back) const {
  const Frame base = Frame::FromNormal(surface_.side(vertex, back).normal);
  const uint32_t node = input_.domain.RowNode(vertex);
  const float angle = 2 * kPi * CounterRng(settings_.seed, node, back, 0x4C617474u).Uniform();
  const float c = std::cos(angle), s = std::sin(angle);
  return {c * base.t + s * base.b, c * base.b - s * base.t, base.n};
}

std::unique_ptr<HitSet> HitSetCache::Trace(uint32_t vertex, bool back) const {
  const HemisphereLattice& lattice = this->lattice(vertex);
  thread_local FanBuffers buffers;
  Fan fan(input_, surface_, surface_.side(vertex, back), vertex, LatticeFrame(vertex, back), lattice,
          &buffers);
  fan.Trace(settings_.split_levels);
  auto set = std::make_unique<HitSet>(HitSetBuilder(fan).Build());
  set->lobe_weights.assign(input_.grid.size() * static_cast<size_t>(input_.domain.max_lobes()) + 1, -1.0f);
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
