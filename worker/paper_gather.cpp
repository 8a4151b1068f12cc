// Gathering as in laurijssen2011 section 5: for every slice and every layer, rays are drawn from the slice's
// lobe; those that leave the scene make up the direct term (Eq. 9), and what the others meet is interpolated
// (Eq. 7) and merged into one lobe (Eq. 10, 11; corrected forms in docs/mathematics.md). Kept for comparison.
// Changed: rays that the lobe sends under the surface are drawn again, since no BRDF reflects there; and
// kappa comes from the exact relation.
#include "worker/paper_gather.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>

#include "common/base/frame.h"
#include "common/base/rng.h"
#include "common/lobes/vmf.h"
#include "worker/layer_light.h"
#include "worker/slice_encoder.h"
#include "worker/slice_lobes.h"
#include "worker/surface_vertices.h"

namespace glint {
namespace {

constexpr int kMaxDrawsPerRay = 16;

class PaperGatherer : public Gatherer {
 public:
  PaperGatherer(const GatherInput& input, const BakeSettings& settings, PaperTracing tracing)
      : input_(input),
        settings_(settings),
        tracing_(tracing),
        surface_(input.domain, input.rays.epsilon()),
        samplers_(MakeSliceSamplers(input.domain.shapes)) {}

  void BeginLayer(int layer, const LayerViews* previous, int threads,
                  std::span<const uint64_t> row_sums) override {
    layer_ = layer;
    light_.reset();
    if (layer > 0)
      light_ =
          std::make_unique<LayerLight>(input_.domain, input_.grid, *previous, layer - 1, threads, row_sums);
  }

  Status status() const override { return light_ ? light_->status() : Status(); }

  BlockResult Gather(const GatherBlock& block) override {
    BlockResult result;
    const int slots = input_.domain.max_lobes();
    result.slots.resize(static_cast<size_t>(slots) + 1);
    Fan fan;
    for (uint32_t v = block.first_vertex; v < block.first_vertex + block.vertices; ++v) {
      for (int slot = 0; slot < slots; ++slot) result.slots[slot].BeginRow();
      if (block.first_column == 0) result.slots.back().BeginRow();
      if (!surface_.used(v)) continue;
      if (block.first_column == 0) GatherDiffuse(v, &fan, &result);
      for (uint32_t column = block.first_column; column < block.first_column + block.columns; ++column)
        GatherSlices(v, column, &fan, &result);
    }
    return result;
  }

 private:
  struct Fan {
    std::vector<Ray> rays;
    std::vector<Hit> hits;
    std::vector<LightQuery> queries;
    std::vector<HitLight> answers;
  };

  void GatherSlices(uint32_t v, uint32_t column, Fan* fan, BlockResult* result) {
    const glm::vec3& wo = input_.grid.direction(column);
    const BakeVertex vertex = input_.domain.Row(v);
    const float cosine = glm::dot(vertex.normal, wo);
    if (cosine == 0 || (cosine < 0 && !vertex.double_sided)) return;
    const VertexSide side = surface_.side(v, cosine < 0);
    const SliceSampler& sampler = samplers_[vertex.shape];
    const UnoccludedSlice slice(sampler, side.normal, wo);
    for (int k = 0; k < slice.lobes.lobes; ++k) {
      const Vmf drawn{slice.Direction(slice.lobes.lobe[k]), slice.lobes.lobe[k].kappa};
      const BrdfLobe seen = slice.Seen(sampler, k);
      CounterRng rng(settings_.seed, vertex.node, column | (static_cast<uint32_t>(k) << 16),
                     static_cast<uint32_t>(layer_));
      Trace(side, &rng, fan, [&](float a, float b) { return SampleVmf(drawn, a, b); });
      if (fan->rays.empty())
        TraceCosine(side, side.geometric, &rng, fan);  // all of the lobe is under the faces
      Merge(v, {slice.Direction(seen), seen.kappa}, fan, static_cast<uint16_t>(column), &result->slots[k],
            &result->counters);
    }
  }

  void GatherDiffuse(uint32_t v, Fan* fan, BlockResult* result) {
    const BakeVertex vertex = input_.domain.Row(v);
    const glm::vec3& diffuse = vertex.diffuse;
    if (diffuse.x + diffuse.y + diffuse.z <= 0) return;
    for (int s = 0; s < (vertex.double_sided ? 2 : 1); ++s) {
      const VertexSide side = surface_.side(v, s == 1);
      CounterRng rng(settings_.seed, vertex.node, 0xFFFF0000u | static_cast<uint32_t>(s),
                     static_cast<uint32_t>(layer_));
      TraceCosine(side, side.normal, &rng, fan);
      const SliceLobe lobe{side.normal, kCosineKappa};
      Merge(v, lobe, fan, static_cast<uint16_t>(s), &result->slots.back(), &result->counters);
    }
  }

  void TraceCosine(const VertexSide& side, const glm::vec3& normal, CounterRng* rng, Fan* fan) const {
    const Frame frame = Frame::FromNormal(normal);
    Trace(side, rng, fan, [&](float a, float b) {
      const float r = std::sqrt(a), phi = 2 * kPi * b;
      return frame.ToWorld({r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - a)});
    });
  }

  template <class Sample>
  void Trace(const VertexSide& side, CounterRng* rng, Fan* fan, const Sample& sample) const {
    const auto wanted = static_cast<size_t>(settings_.paper_rays);
    fan->rays.clear();
    for (int draw = 0; draw < kMaxDrawsPerRay * settings_.paper_rays && fan->rays.size() < wanted; ++draw) {
      const float a = rng->Uniform(), b = rng->Uniform();
      Ray ray;
      ray.origin = side.origin;
      ray.direction = sample(a, b);
      if (glm::dot(ray.direction, side.normal) > 0 && side.Faces(ray.direction)) fan->rays.push_back(ray);
    }
    fan->hits.resize(fan->rays.size());
    if (tracing_ == PaperTracing::kPackets) {
      input_.rays.IntersectCoherent(fan->rays.data(), fan->hits.data(), static_cast<int>(fan->rays.size()));
    } else {
      std::transform(fan->rays.begin(), fan->rays.end(), fan->hits.begin(),
                     [&](const Ray& ray) { return input_.rays.Intersect(ray); });
    }
  }

  void Merge(uint32_t v, const SliceLobe& lobe, Fan* fan, uint16_t column, BlockRows* rows,
             GatherCounters* counters) const {
    ++counters->slices;
    counters->rays += fan->rays.size();
    double count = 0;
    DirectMoments direct{0, {}};
    fan->queries.clear();
    for (size_t i = 0; i < fan->rays.size(); ++i) {
      const Hit& hit = fan->hits[i];
      if (surface_.Touches(v, hit)) continue;
      count += 1;
      if (!hit.hit()) {
        direct.visible += 1;
        direct.mean += glm::dvec3(fan->rays[i].direction);
      } else {
        fan->queries.push_back({hit.triangle, hit.u, hit.v, -fan->rays[i].direction});
      }
    }
    if (count == 0) return;
    if (layer_ == 0) {
      direct.visible /= count;
      direct.mean /= count;
      StoreDirect(FitDirect(lobe, direct, settings_.drop), column, rows);
    } else {
      StoreIndirect(FitIndirect(lobe, SumLight(count, fan), settings_.drop), column, rows);
    }
  }

  IndirectMoments SumLight(double count, Fan* fan) const {
    fan->answers.resize(fan->queries.size());
    light_->Look(fan->queries, fan->answers.data());
    IndirectMoments sum;
    for (const HitLight& light : fan->answers) {
      sum.alpha += glm::dvec3(light.alpha);
      sum.moment += glm::dvec3(light.moment);
    }
    sum.alpha /= count;
    sum.moment /= count;
    return sum;
  }

  const GatherInput input_;
  const BakeSettings settings_;
  const PaperTracing tracing_;
  const SurfaceVertices surface_;
  std::vector<SliceSampler> samplers_;  ///< of input_.domain.shapes
  int layer_ = 0;
  std::unique_ptr<const LayerLight> light_;  ///< of the layer before
};

}  // namespace

std::unique_ptr<Gatherer> MakePaperGatherer(const GatherInput& input, const BakeSettings& settings,
                                            PaperTracing tracing) {
  return std::make_unique<PaperGatherer>(input, settings, tracing);
}

}  // namespace glint
