// What is lost when slices are read out as 1, 2, 3 or 4 lobes, and as many as the settings find worth it:
// random slices of every layer against all that their samples say. L2 is relative to the slice's own norm,
// with samples as lobes as wide as the light that they bring (layer 0: as the lattice's cells); relit is the
// rms error of the slice's light over turned skies, relative to its rms. No interpolation is involved.
//
//   glint_benchmark_lobes [SCENE [EXPONENT [VERTICES [SLICES]]]]
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <glm/geometric.hpp>
#include <memory>
#include <string>
#include <vector>

#include "common/archive/archive.h"
#include "common/base/frame.h"
#include "common/base/parallel.h"
#include "common/base/rng.h"
#include "common/render/environment.h"
#include "common/render/prefilter.h"
#include "common/scene/generate.h"
#include "coordinator/bake.h"
#include "worker/hemisphere_samples.h"
#include "worker/hit_set.h"
#include "worker/light_groups.h"
#include "worker/slice_lobes.h"

namespace glint {
namespace {

constexpr float kCutoff = -7;  ///< of a lobe's exponent
constexpr int kLayers = 3, kTurns = 8, kSkies = 2;
constexpr const char* kSkyNames[kSkies] = {"sunset", "studio"};
constexpr int kSchemes = kMaxSliceLobes + 1;  ///< 1 .. kMaxSliceLobes lobes, then by the tolerance

struct Lobe {
  glm::vec3 light;
  Vmf vmf;
};

/// A slice's samples: as lobes, and as the list that is grouped.
struct Samples {
  std::vector<Lobe> lobes;
  LightSamples list;

  void Add(const glm::vec3& light, const glm::vec3& moment, const Vmf& vmf) {
    lobes.push_back({light, vmf});
    list.Add(light, moment);
  }
};

double Product(const std::vector<Lobe>& a, const std::vector<Lobe>& b) {
  double sum = 0;
  for (const Lobe& x : a)
    for (const Lobe& y : b)
      sum += double{Luminance(x.light)} * Luminance(y.light) * VmfInnerProduct(x.vmf, y.vmf);
  return sum;
}

struct Scheme {
  double lobes = 0, l2 = 0, relit[kSkies] = {}, bias[kSkies] = {};
};

/// Sums over slices; squares where squares belong.
struct Result {
  int slices = 0;
  double light[kSkies] = {}, light2[kSkies] = {};
  Scheme scheme[kSchemes];
};

class LobeBenchmark {
 public:
  LobeBenchmark(const Scene& scene, const Archive& archive)
      : archive_(archive),
        domain_(archive.domain()),
        grid_(archive.MakeGrid()),
        rays_(scene, 0),
        input_{domain_, rays_, grid_},
        cache_(input_, settings_, uint64_t{2} << 30),
        samplers_(MakeSliceSamplers(domain_.shapes)) {
    for (const char* name : kSkyNames) skies_.emplace_back(*Environment::Procedural(name));
  }

  void Run(int layer, int slices) {
    if (layer > 0)
      light_ = std::make_unique<LayerLight>(domain_, grid_, archive_.layers()[layer - 1], layer - 1, 0);
    std::vector<Result> results(static_cast<size_t>(slices));
    ParallelFor(results.size(), 0, 1, [&](size_t i, int) {
      Measure(CounterRng(1, static_cast<uint32_t>(i), static_cast<uint32_t>(layer), 0x4C6F6265u),
              &results[i]);
    });
    Print(layer, results);
  }

 private:
  void Measure(CounterRng rng, Result* result) {
    const uint32_t v = rng.Bits() % domain_.vertex_count(), column = rng.Bits() % grid_.size();
    const glm::vec3& wo = grid_.direction(column);
    if (!cache_.surface().used(v) || glm::dot(wo, domain_.normals[v]) <= 0) return;
    const SliceSampler& sampler = samplers_[domain_.shape[v]];
    if (sampler.lobes() == 0) return;
    const int k = static_cast<int>(rng.Bits() % static_cast<uint32_t>(sampler.lobes()));
    SliceLobe lobe;
    Samples samples = Gather(v, wo, sampler, k, &lobe);
    float turns[kTurns];
    for (float& turn : turns) turn = 360 * rng.Uniform();
    if (!samples.lobes.empty()) Judge(&samples, lobe, turns, result);
  }

  /// The slice's samples, relative to the sum of all weights; none for a slice that is free, or all but dark.
  Samples Gather(uint32_t v, const glm::vec3& wo, const SliceSampler& sampler, int k, SliceLobe* lobe) {
    std::unique_ptr<HitSet> keep;
    const HitSet& hits = cache_.Get(v, false, &keep);
    const HemisphereLattice& lattice = cache_.lattice(v);
    const Frame frame = cache_.LatticeFrame(v, false);
    HemisphereSamples hemisphere;
    hemisphere.Expand(hits, lattice);
    if (light_)
      hemisphere.Shade(hits, {lattice, frame, cache_.surface().side(v, false).origin}, rays_, *light_, 0);
    const SampleArrays a = hemisphere.arrays();
    const UnoccludedSlice slice(sampler, frame.n, wo);
    const BrdfLobe &fitted = slice.lobes.lobe[k], seen = slice.Seen(sampler, k);
    *lobe = {slice.Direction(seen), seen.kappa, 1};
    const glm::vec3 axis = frame.ToLocal(slice.Direction(fitted));
    const auto weight = [&](uint32_t i) {
      const float exponent = fitted.kappa * (glm::dot(axis, {a.x[i], a.y[i], a.z[i]}) - 1);
      return exponent < kCutoff ? 0.0f : std::exp(exponent);
    };
    double all = 0, blocked = 0;
    for (uint32_t i = 0; i < hemisphere.samples(); ++i) {
      all += weight(i) * a.solid_angle[i];
      blocked += weight(i) * a.solid_angle[i] * a.blocked[i];
    }
    Samples samples;
    if (blocked < 1e-3 * all) return samples;
    for (const uint16_t tile : light_ ? hemisphere.active_tiles() : lattice.all_tiles())
      for (uint32_t i = a.tile_begin[tile]; i < a.tile_begin[tile + 1]; ++i)
        AddSample(a, i, weight(i) / static_cast<float>(all), frame, &samples);
    double strength = 0;
    for (const Lobe& l : samples.lobes) strength += Luminance(l.light);
    if (strength < 1e-3) samples.lobes.clear();
    return samples;
  }

  void AddSample(const SampleArrays& a, uint32_t i, float weight, const Frame& frame,
                 Samples* samples) const {
    if (weight <= 0 || a.solid_angle[i] <= 0) return;
    const glm::vec3 direction = frame.ToWorld({a.x[i], a.y[i], a.z[i]});
    const glm::vec3 light = weight * (light_ ? glm::vec3(a.light[0][i], a.light[1][i], a.light[2][i])
                                             : glm::vec3(a.solid_angle[i] * (1 - a.blocked[i])));
    const glm::vec3 moment =
        light_ ? weight * glm::vec3(a.light[3][i], a.light[4][i], a.light[5][i]) : light.x * direction;
    const float strength = Luminance(light), length = glm::length(moment);
    if (strength <= 0 || length <= 0) return;
    const float cell_kappa = 4 * kPi / a.solid_angle[i];
    const float kappa = KappaFromDelta(std::clamp(1 - length / strength, 0.0f, 1.0f));
    samples->Add(light, moment, {moment / length, light_ ? std::min(kappa, 4 * cell_kappa) : cell_kappa});
  }

  void Judge(Samples* samples, const SliceLobe& lobe, const float* turns, Result* result) const {
    result->slices = 1;
    const double norm2 = Product(samples->lobes, samples->lobes);
    const auto truth = Relight(samples->lobes, turns);
    for (int i = 0; i < kSkies * kTurns; ++i) {
      result->light[i / kTurns] += truth[i] / kTurns;
      result->light2[i / kTurns] += truth[i] * truth[i] / kTurns;
    }
    const LightGroups all = GroupLight(SelectGatherKernels(), samples->list.List(), samples->list.total(), 0);
    for (int n = 1; n <= kSchemes; ++n) {
      LightGroups groups = all;
      JoinLikeGroups(std::min(n, kMaxSliceLobes), n < kSchemes ? 0 : settings_.lobe_tolerance, &groups);
      std::vector<Lobe> lobes;
      for (const LightGroup& g : groups)
        lobes.push_back({glm::vec3(g.colour), LobeOf(g.moment, g.strength, lobe)});
      Scheme& scheme = result->scheme[n - 1];
      scheme.lobes = groups.size();
      scheme.l2 = (norm2 + Product(lobes, lobes) - 2 * Product(lobes, samples->lobes)) / norm2;
      const auto relit = Relight(lobes, turns);
      for (int i = 0; i < kSkies * kTurns; ++i) {
        const double error = relit[i] - truth[i];
        scheme.relit[i / kTurns] += error * error / kTurns;
        scheme.bias[i / kTurns] += error / kTurns;
      }
    }
  }

  std::array<double, kSkies * kTurns> Relight(const std::vector<Lobe>& lobes, const float* turns) const {
    std::array<double, kSkies * kTurns> light{};
    for (int i = 0; i < kSkies * kTurns; ++i) {
      const LookupFrame frame(turns[i % kTurns]);
      for (const Lobe& l : lobes)
        light[i] += Luminance(l.light * skies_[i / kTurns].Filtered(frame.ToLookup(l.vmf.mu), l.vmf.kappa));
    }
    return light;
  }

  static void Print(int layer, const std::vector<Result>& results) {
    Result sum;
    for (const Result& r : results) {
      sum.slices += r.slices;
      for (int e = 0; e < kSkies; ++e) sum.light[e] += r.light[e], sum.light2[e] += r.light2[e];
      for (int i = 0; i < kSchemes && r.slices > 0; ++i) {
        const Scheme& s = r.scheme[i];
        sum.scheme[i].lobes += s.lobes, sum.scheme[i].l2 += s.l2;
        for (int e = 0; e < kSkies; ++e)
          sum.scheme[i].relit[e] += s.relit[e], sum.scheme[i].bias[e] += s.bias[e];
      }
    }
    std::printf("layer %d: %d slices\n", layer, sum.slices);
    for (int i = 0; i < kSchemes && sum.slices > 0; ++i) {
      const Scheme& s = sum.scheme[i];
      const double lobes = s.lobes / sum.slices;
      std::printf("  %-10s %5.2f lobes %5.1f bytes  L2 %.3f", i < kMaxSliceLobes ? "at most" : "tolerance",
                  lobes, lobes * kIndirectEntryBytes, std::sqrt(s.l2 / sum.slices));
      for (int e = 0; e < kSkies; ++e)
        std::printf("  %s: relit %.3f, mean %+.3f", kSkyNames[e], std::sqrt(s.relit[e] / sum.light2[e]),
                    s.bias[e] / sum.light[e]);
      std::printf("\n");
    }
    std::fflush(stdout);
  }

  const Archive& archive_;
  const BakeSettings settings_;
  const BakeDomain& domain_;
  const DirectionGrid grid_;
  const RayScene rays_;
  const GatherInput input_;
  HitSetCache cache_;
  std::vector<SliceSampler> samplers_;
  std::vector<PrefilteredEnvironment> skies_;
  std::unique_ptr<const LayerLight> light_;
};

Status Run(const std::string& name, float exponent, uint32_t vertices, int slices) {
  GLINT_ASSIGN_OR_RETURN(const Scene scene, GenerateScene(name, {vertices, exponent}));
  const auto path =
      std::filesystem::temp_directory_path() / ("glint-lobes-" + std::to_string(getpid()) + ".glint");
  BakeOptions options;
  options.max_layers = kLayers - 1;
  options.layer_tolerance = 0;
  GLINT_RETURN_IF_ERROR(BakeScene(scene, name, path, options).status());
  GLINT_ASSIGN_OR_RETURN(const Archive archive, Archive::Open(path));
  std::filesystem::remove(path);
  std::filesystem::remove(path.string() + ".json");
  std::printf("%s, exponent %g, %u vertices\n", name.c_str(), exponent, archive.domain().vertex_count());
  LobeBenchmark benchmark(scene, archive);
  for (int layer = 0; layer < kLayers; ++layer) benchmark.Run(layer, slices);
  return {};
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) {
  const glint::Status status = glint::Run(
      argc > 1 ? argv[1] : "goblets", argc > 2 ? std::stof(argv[2]) : 64.0f,
      argc > 3 ? static_cast<uint32_t>(std::stoul(argv[3])) : 8000, argc > 4 ? std::stoi(argv[4]) : 4000);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.message().c_str());
  return status.ok() ? 0 : 1;
}
