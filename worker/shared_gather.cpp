// Gathering with one shared set of hemisphere rays per bake vertex. Where laurijssen2011 traces 144 rays for
// every slice in every layer, here a vertex's hemisphere is traced once, on a lattice of equal solid angles
// that is finer where neighbouring rays see different surfaces. Every view direction, lobe and layer is a
// weighted sum over those samples.
#include "worker/shared_gather.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <span>
#include <utility>

#include "common/archive/transfer.h"
#include "common/lobes/slice_sampler.h"
#include "common/lobes/vmf.h"
#include "worker/aimed_lobes.h"
#include "worker/angular_refinement.h"
#include "worker/gather_kernel.h"
#include "worker/hemisphere_samples.h"
#include "worker/hit_set.h"
#include "worker/layer_light.h"
#include "worker/lobe_rays.h"
#include "worker/slice_encoder.h"
#include "worker/slice_writer.h"

namespace glint {
namespace {

constexpr float kDark = 0.125f;          ///< light below this part of what is dropped is none
constexpr float kWidthsApart = 4;        ///< directions at which all slices of a vertex are computed
constexpr float kKappaPerSample = 0.6f;  ///< a lattice of n samples resolves lobes up to about 0.6 n
/// Lobes that are resolved less than this have rays of their own. With those up to 1 there was more to trace
/// at exponent 4096 and 8192 cells (0.91), and no error smaller; at 8192 (0.62) errors fell to two fifths.
constexpr float kTooCoarse = 0.75f;
/// Broader ones have none: however coarse the shared rays were asked to be, a few more of them serve many
/// directions.
constexpr float kSharp = 2000;

/// Level of the directions whose views together see everything: a lobe of this kappa, turning with the mirror
/// direction, sees up to twice its width 1 / sqrt(kappa) to each side.
int LevelOfDetail(float kappa) {
  constexpr float kIcosahedronEdge = 1.1071487f;
  int level = 0;
  for (float edge = kIcosahedronEdge; edge * std::sqrt(kappa) > kWidthsApart; edge /= 2) ++level;
  return level;
}

/// Buffers of one thread.
struct Scratch {
  HemisphereSamples samples[2];  ///< front, back
  AimedLobes aimed[2];           ///< the same
  std::vector<uint16_t> tiles;   ///< that a slice is gathered from
  std::vector<uint16_t> near;    ///< that a lobe meets
  std::array<std::vector<float>, LightList::kChannels> channels;
  std::unique_ptr<AngularRefinement> refinement;  ///< of nested grids
  std::unique_ptr<LobeRays> own_rays;             ///< if slices may have some

  /// An empty list with room for as many samples.
  LightList List(size_t room) {
    LightList list{};
    for (int c = 0; c < LightList::kChannels; ++c) {
      channels[c].resize(std::max(channels[c].size(), room));
      list.channel[c] = channels[c].data();
    }
    return list;
  }
};

/// One side of a vertex, ready to be summed over.
struct Side {
  uint32_t row;
  bool back;
  std::unique_ptr<HitSet> keep;  ///< the hit set where the cache has no room for it
  const HemisphereLattice* lattice;
  Frame frame;  ///< lattice to world; n is the side's shading normal
  const HemisphereSamples* samples;
  AimedLobes* aimed;
  SampleArrays arrays;
  float* lobe_weights;  ///< HitSet::lobe_weights
  float max_kappa;
  glm::vec3 geometric;  ///< VertexSide::geometric, in the lattice's frame
};

class SharedGatherer : public Gatherer {
 public:
  SharedGatherer(const GatherInput& input, const BakeSettings& settings, uint64_t memory_bytes)
      : input_(input),
        settings_(settings),
        kernels_(SelectGatherKernels()),
        samplers_(MakeSliceSamplers(input.domain.shapes)),
        layout_{static_cast<uint32_t>(input.domain.max_lobes()), settings.StoredLobes()},
        writer_(kernels_, settings.read_out(), layout_.stride()),
        cache_(input_, settings_, memory_bytes) {}

  void BeginLayer(int layer, const LayerViews* previous, int threads,
                  std::span<const uint64_t> row_sums) override {
    light_.reset();
    if (layer > 0)
      light_ =
          std::make_unique<LayerLight>(input_.domain, input_.grid, *previous, layer - 1, threads, row_sums);
  }

  Status status() const override { return light_ ? light_->status() : Status(); }

  BlockResult Gather(const GatherBlock& block) override {
    BlockResult result;
    result.slots.resize(layout_.count());
    Scratch scratch;
    if (input_.grid.nested())
      scratch.refinement = std::make_unique<AngularRefinement>(input_.grid, layout_, light_ == nullptr,
                                                               settings_.angular_tolerance);
    if (settings_.own_rays > 0)
      scratch.own_rays = std::make_unique<LobeRays>(input_, cache_.surface(), settings_);
    for (uint32_t v = block.first_vertex; v < block.first_vertex + block.vertices; ++v)
      GatherVertex(v, block, &scratch, &result);
    return result;
  }

 private:
  void GatherVertex(uint32_t v, const GatherBlock& block, Scratch* scratch, BlockResult* result) {
    const bool owns_diffuse = block.first_column == 0;
    for (uint32_t slot = 0; slot < layout_.count(); ++slot)
      if (owns_diffuse || !layout_.is_diffuse(slot)) result->slots[slot].BeginRow();
    if (!cache_.surface().used(v)) return;
    Side sides[2];
    const BakeVertex vertex = input_.domain.Row(v);
    const int side_count = vertex.double_sided ? 2 : 1;
    for (int s = 0; s < side_count; ++s) {
      sides[s] = PrepareSide(v, s, scratch, owns_diffuse ? &result->counters : nullptr);
      if (owns_diffuse) GatherDiffuse(vertex.diffuse, s, sides[s], scratch, result);
    }
    if (scratch->refinement) {
      RefineVertex(vertex.shape, {sides, static_cast<size_t>(side_count)}, block, scratch, result);
      return;
    }
    for (int s = 0; s < side_count; ++s) Aim(vertex.shape, block.first_column, block.columns, sides[s]);
    const AimedLobes &front = scratch->aimed[0], &back = scratch->aimed[1];
    const size_t back_size = side_count == 2 ? back.size() : 0;
    for (size_t f = 0, b = 0; f < front.size() || b < back_size;) {
      const bool in_front = b == back_size || (f < front.size() && front.column(f) < back.column(b));
      GatherSlices(in_front ? f++ : b++, sides[in_front ? 0 : 1], scratch, result);
    }
  }

  void Aim(uint16_t shape, uint32_t first_column, uint32_t columns, const Side& side) const {
    side.aimed->Aim(input_.grid, first_column, columns, samplers_[shape], side.frame, side.max_kappa);
  }

  /// Every block of a vertex does all of this, and keeps what is its own.
  void RefineVertex(uint16_t shape, std::span<const Side> sides, const GatherBlock& block, Scratch* scratch,
                    BlockResult* result) {
    const SliceSampler& sampler = samplers_[shape];
    const float kappa = SharpestKappa(input_.domain.shapes[shape]);
    AngularRefinement& refinement = *scratch->refinement;
    refinement.Begin();
    for (const Side& side : sides) {
      if (!side.samples->any_active()) continue;
      refinement.Refine({side.frame.n, sampler.lobes(), LevelOfDetail(kappa), kappa,
                         [&](uint32_t column, BlockResult* out) {
                           const uint64_t rays_before = out->counters.rays;
                           Aim(shape, column, 1, side);
                           for (size_t i = 0; i < side.aimed->size(); ++i)
                             GatherSlices(i, side, scratch, out);
                           if (column - block.first_column < block.columns)
                             result->counters.rays += out->counters.rays - rays_before;
                         }});
    }
    result->counters.slices += refinement.Store(block, result) * static_cast<uint64_t>(sampler.lobes());
  }

  Side PrepareSide(uint32_t v, int s, Scratch* scratch, GatherCounters* counters) {
    Side side;
    side.row = v;
    side.back = s == 1;
    const HitSet& hits = cache_.Get(v, s, &side.keep);
    if (!light_ && counters) counters->rays += hits.rays;
    const HemisphereLattice& lattice = cache_.lattice(v);
    HemisphereSamples& samples = scratch->samples[s];
    side.lattice = &lattice;
    side.frame = cache_.LatticeFrame(v, s);
    side.samples = &samples;
    side.aimed = &scratch->aimed[s];
    samples.Expand(hits, lattice);
    side.lobe_weights = hits.lobe_weights.data();
    const VertexSide start = cache_.surface().side(v, s);
    side.geometric = side.frame.ToLocal(start.geometric);
    if (light_) {
      const LatticePose pose{lattice, side.frame, start.origin};
      const uint64_t rays = samples.Shade(hits, pose, input_.rays, *light_, kDark * settings_.drop);
      if (counters) counters->rays += rays;
    }
    side.arrays = samples.arrays();
    side.max_kappa = kKappaPerSample * static_cast<float>(lattice.cells());
    for (auto* tiles : {&scratch->tiles, &scratch->near})
      tiles->resize(std::max<size_t>(tiles->size(), lattice.tiles() + kLanes));
    return side;
  }

  /// @param i  of side.aimed
  void GatherSlices(size_t i, const Side& side, Scratch* scratch, BlockResult* result) {
    const AimedLobes& aimed = *side.aimed;
    result->counters.slices += static_cast<uint64_t>(aimed.lobes());
    if (!side.samples->any_active()) return;
    const uint16_t column = aimed.column(i);
    for (int k = 0; k < aimed.lobes(); ++k) {
      const QueryCone cone = aimed.cone(i, k);
      const LobeWeight weight = aimed.weight(i, k);
      const bool sunk = glm::dot(glm::vec3(cone.x, cone.y, cone.z), side.geometric) < 0 &&
                        SumDirect(side, cone, weight, scratch).all <= 0;
      const int active =
          light_ ? SelectActive(side, cone, scratch) : kernels_.any_tile(side.samples->active_cones(), cone);
      if (active == 0 && !sunk) continue;
      const SliceLobe lobe{side.frame.ToWorld(aimed.seen_mu(i, k)), aimed.seen_kappa(i, k),
                           aimed.resolution(i, k)};
      const SlicePlace place{column, static_cast<uint32_t>(k)};
      float& all = side.lobe_weights[column * static_cast<size_t>(input_.domain.max_lobes()) + k];
      if (sunk) {  // no sample of it leaves the surface: what the surface sees is the best that is known
        StoreCosine(side, lobe, 1 - DeltaFromKappa(lobe.resolved_kappa()), place, &all, scratch, result);
        continue;
      }
      const bool too_coarse = lobe.resolution < kTooCoarse && lobe.kappa > kSharp;
      if (too_coarse && scratch->own_rays &&
          GatherByOwnRays({side.row, side.back, column, k, ToWorld(aimed.fitted(i, k), side.frame)}, lobe,
                          SumDirect(side, cone, weight, scratch), place, scratch, result))
        continue;
      if (!light_) {
        const DirectSums sums = SumDirect(side, cone, weight, scratch);
        all = sums.all;
        const DirectMoments moments =
            ToMoments(sums, side, lobe.mu, 1 - DeltaFromKappa(lobe.resolved_kappa()));
        StoreDirectSlice(
            lobe, moments, sums, place, side,
            [&](LightList* out) {
              const int count = kernels_.select_tiles(side.lattice->cones(), cone, scratch->tiles.data());
              kernels_.list_visible_lobe(side.arrays, scratch->tiles.data(), count, weight, out);
            },
            scratch, result);
      } else {
        if (all < 0) all = SumDirect(side, cone, weight, scratch).all;
        IndirectSums sums;
        kernels_.indirect_lobe(side.arrays, scratch->tiles.data(), active, weight, &sums);
        const auto list = [&](LightList* out) {
          kernels_.list_lobe(side.arrays, scratch->tiles.data(), active, weight, out);
        };
        StoreIndirectSlice(lobe, sums, all, place, side, list, scratch, result);
      }
    }
  }

  static Vmf ToWorld(const Vmf& lobe, const Frame& frame) { return {frame.ToWorld(lobe.mu), lobe.kappa}; }

  /// Stores a slice that the shared rays are too coarse for. False: nor do rays of its own tell more.
  /// @param sums  over the lobe as broad as the shared rays resolve
  bool GatherByOwnRays(const DrawnLobe& drawn, SliceLobe lobe, const DirectSums& sums,
                       const SlicePlace& place, Scratch* scratch, BlockResult* result) {
    const SharedView view = ViewOf(sums, lobe.resolution);
    if (view == SharedView::kFree) return true;
    if (view == SharedView::kBlocked && !light_) {
      StoreDirect(DirectLobe{.fraction = 0}, place.column, &result->slots[place.slot]);
      return true;
    }
    LobeRays& rays = *scratch->own_rays;
    result->counters.rays += rays.Trace(drawn, view);
    if (!rays.usable()) return false;
    lobe.resolution = 1;
    if (!light_) {
      writer_.Direct(
          lobe, rays.Direct(lobe), place, [&] { return rays.Visible(); },
          [](const glm::dvec3& v) { return v; }, result);
    } else {
      writer_.Indirect(
          lobe, rays.Indirect(*light_), rays.leaving(), place, [&] { return rays.Light(); }, result);
    }
    return true;
  }

  /// @param all   sum of its weights
  /// @param list  lists its light
  template <class List>
  void StoreIndirectSlice(const SliceLobe& lobe, const IndirectSums& sums, float all, const SlicePlace& place,
                          const Side& side, const List& list, Scratch* scratch, BlockResult* result) const {
    const auto light = [&] {
      LightList out = scratch->List(side.samples->samples());
      list(&out);
      return out;
    };
    writer_.Indirect(lobe, ToMoments(sums, all), all, place, light, result);
  }

  /// @param sums  over all its samples
  /// @param list  lists what is visible
  template <class List>
  void StoreDirectSlice(const SliceLobe& lobe, const DirectMoments& moments, const DirectSums& sums,
                        const SlicePlace& place, const Side& side, const List& list, Scratch* scratch,
                        BlockResult* result) const {
    const auto see = [&] {
      VisibleLight light{scratch->List(side.samples->samples()), VisibleOf(sums)};
      list(&light.list);
      return light;
    };
    const auto to_world = [&](const glm::dvec3& v) { return glm::dvec3(side.frame.ToWorld(glm::vec3(v))); };
    writer_.Direct(lobe, moments, place, see, to_world, result);
  }

  /// What is not blocked, as white light.
  static LightGroup VisibleOf(const DirectSums& sums) {
    const double strength = double{sums.all} - double{sums.blocked};
    return {strength,
            glm::dvec3(sums.all_x, sums.all_y, sums.all_z) -
                glm::dvec3(sums.blocked_x, sums.blocked_y, sums.blocked_z),
            glm::dvec3(strength)};
  }

  /// Writes the active tiles that a cone meets to scratch->tiles; returns how many.
  int SelectActive(const Side& side, const QueryCone& cone, Scratch* scratch) const {
    uint16_t* tiles = scratch->tiles.data();
    const int count = kernels_.select_tiles(side.samples->active_cones(), cone, tiles);
    for (int i = 0; i < count; ++i) tiles[i] = side.samples->active_tiles()[tiles[i]];
    return count;
  }

  DirectSums SumDirect(const Side& side, const QueryCone& cone, const LobeWeight& weight,
                       Scratch* scratch) const {
    uint16_t* tiles = scratch->near.data();
    DirectSums sums;
    const int count = kernels_.select_tiles(side.lattice->cones(), cone, tiles);
    kernels_.direct_lobe(side.arrays, tiles, count, weight, &sums);
    return sums;
  }

  void GatherDiffuse(const glm::vec3& diffuse, int s, const Side& side, Scratch* scratch,
                     BlockResult* result) {
    if (diffuse.x + diffuse.y + diffuse.z <= 0) return;
    ++result->counters.slices;
    if (!side.samples->any_active()) return;
    float& all = side.lobe_weights[input_.grid.size() * static_cast<size_t>(input_.domain.max_lobes())];
    StoreCosine(side, {side.frame.n, kCosineKappa}, 2.0 / 3, {static_cast<uint16_t>(s), layout_.specular},
                &all, scratch, result);
  }

  /// Stores for a lobe what the cosine lobe's sums say.
  /// @param all  of HitSet::lobe_weights
  void StoreCosine(const Side& side, const SliceLobe& lobe, double mean_cosine, const SlicePlace& place,
                   float* all, Scratch* scratch, BlockResult* result) const {
    if (!light_) {
      const DirectSums sums = SumDirectCosine(side);
      *all = sums.all;
      StoreDirectSlice(
          lobe, ToMoments(sums, side, lobe.mu, mean_cosine), sums, place, side,
          [&](LightList* out) {
            const std::vector<uint16_t>& tiles = side.lattice->all_tiles();
            kernels_.list_visible_cosine(side.arrays, tiles.data(), static_cast<int>(tiles.size()), out);
          },
          scratch, result);
    } else {
      const std::vector<uint16_t>& tiles = side.samples->active_tiles();
      IndirectSums sums;
      kernels_.indirect_cosine(side.arrays, tiles.data(), static_cast<int>(tiles.size()), &sums);
      if (*all < 0) *all = SumDirectCosine(side).all;
      const auto list = [&](LightList* out) {
        kernels_.list_cosine(side.arrays, tiles.data(), static_cast<int>(tiles.size()), out);
      };
      StoreIndirectSlice(lobe, sums, *all, place, side, list, scratch, result);
    }
  }

  DirectSums SumDirectCosine(const Side& side) const {
    const std::vector<uint16_t>& tiles = side.lattice->all_tiles();
    DirectSums sums;
    kernels_.direct_cosine(side.arrays, tiles.data(), static_cast<int>(tiles.size()), &sums);
    return sums;
  }

  /// The unoccluded lobe's mean is known exactly, so the samples only have to tell what blocking changes:
  ///   mean = visible r mu + h (mean of all - mean of the blocked), h the blocked part,
  /// which is the plain sample mean with the lobe's own sampling error taken out in proportion to what is
  /// visible.
  static DirectMoments ToMoments(const DirectSums& sums, const Side& side, const glm::vec3& mu,
                                 double mean_cosine) {
    if (sums.all <= 0 || sums.blocked <= 0) return {};
    const double h = std::min(1.0, static_cast<double>(sums.blocked) / sums.all);
    const glm::vec3 all = glm::vec3(sums.all_x, sums.all_y, sums.all_z) / sums.all;
    const glm::vec3 blocked = glm::vec3(sums.blocked_x, sums.blocked_y, sums.blocked_z) / sums.blocked;
    const glm::dvec3 change(side.frame.ToWorld(all - blocked));
    return {1 - h, (1 - h) * mean_cosine * glm::dvec3(mu) + h * change};
  }

  /// @param all  sum of the lobe's weights over all samples
  static IndirectMoments ToMoments(const IndirectSums& sums, float all) {
    if (all <= 0) return {};
    const double scale = 1.0 / all;
    return {glm::dvec3(sums.light[0], sums.light[1], sums.light[2]) * scale,
            glm::dvec3(sums.light[3], sums.light[4], sums.light[5]) * scale};
  }

  const GatherInput input_;
  const BakeSettings settings_;
  const GatherKernels& kernels_;
  std::vector<SliceSampler> samplers_;  ///< of input_.domain.shapes
  const SlotLayout layout_;
  const SliceWriter writer_;
  HitSetCache cache_;
  std::unique_ptr<const LayerLight> light_;  ///< of the layer before; null while layer 0 is gathered
};

}  // namespace

std::unique_ptr<Gatherer> MakeSharedGatherer(const GatherInput& input, const BakeSettings& settings,
                                             uint64_t memory_bytes) {
  return std::make_unique<SharedGatherer>(input, settings, memory_bytes);
}

}  // namespace glint
