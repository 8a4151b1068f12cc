// Default gathering against the 2011 scheme, block by block in one interleaved run: CPU seconds, rays, and
// the error of random slices of every layer against the 2011 scheme with 16,384 rays. Those are drawn twice,
// with unlike seeds: with truths s and t the mean of (d(a,s)^2 + d(a,t)^2 - d(s,t)^2) / 2 is the squared
// error of a without the truths' own noise.
//
//   glint_benchmark_bake [--scenes teapot,goblets,knot] [--exponents 32,128,512] [--vertices 25000] [--layers
//   3]
//                        [--paper-every 16] [--slices 2000] [--truth-rays 16384] [--threads N] [--wall]
//                        [--paper-one-by-one] [--json FILE]
//
// The 2011 scheme runs on one in `paper-every` vertices, some of every block, and its time is scaled up by
// the share of vertices that it covered; 1 runs it everywhere. Both schemes gather the same tables of the
// layer before.
// Its rays are traced in packets, as the default's are; `--paper-one-by-one` traces each by itself.
// `--wall` also bakes the whole scene to an archive in a temporary folder and reports its wall seconds.

#include "coordinator/bake.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "common/archive/chunk.h"
#include "common/archive/lobe_codec.h"
#include "common/base/frame.h"
#include "common/base/parallel.h"
#include "common/base/rng.h"
#include "common/domain/bake_domain.h"
#include "common/lobes/vmf.h"
#include "common/scene/generate.h"
#include "common/store/store.h"
#include "coordinator/layer.h"
#include "tests/benchmark/benchmark_support.h"
#include "worker/gather.h"
#include "worker/paper_gather.h"
#include "worker/slice_lobes.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> scenes = {"teapot", "goblets", "knot"};
  std::vector<float> exponents = {32, 128, 512};
  uint32_t vertices = 25000;
  int layers = 3, paper_every = 16, slices = 2000, truth_rays = 16384, threads = 0;
  bool wall = false;
  PaperTracing paper_tracing = PaperTracing::kPackets;
  std::string json;
  BakeSettings settings;
};

double ThreadSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// One slot of one slice as a lobe with weight, relative to its BRDF lobe.
struct SliceValue {
  float alpha = 0;
  Vmf lobe;
};

/// Errors of one scheme on one layer.
struct ErrorSums {
  double l2 = 0, alpha = 0;
  int count = 0;
  double rms_l2() const { return count ? std::sqrt(std::max(l2, 0.0) / count) : 0; }
  double rms_alpha() const { return count ? std::sqrt(std::max(alpha, 0.0) / count) : 0; }
};

struct SchemeResult {
  double cpu_seconds = 0;
  uint64_t rays = 0, slices = 0;
  std::vector<ErrorSums> errors;
};

struct Outcome {
  SchemeResult shared, paper;
  std::vector<double> energy, density;
  double wall_seconds = 0;
};

/// A scene ready to be gathered, with both schemes and the truth.
class Contest {
 public:
  Contest(const Scene& scene, const Arguments& args)
      : args_(args),
        threads_(ResolveThreadCount(args.threads)),
        domain_(BuildBakeDomain(scene, args.settings.fit, threads_)),
        grid_(args.settings.grid_level),
        rays_(scene, threads_),
        input_{domain_, rays_, grid_},
        samplers_(MakeSliceSamplers(domain_.shapes)) {
    BakeSettings paper = args.settings, truth = args.settings;
    paper.method = truth.method = GatherMethod::kPaper;
    truth.paper_rays = args.truth_rays;
    truth.drop = 0;
    truth.seed = args.settings.seed + 1;
    truth_[0] = MakeGatherer(input_, truth, 0);
    truth.seed = args.settings.seed + 2;
    truth_[1] = MakeGatherer(input_, truth, 0);
    shared_ = MakeGatherer(input_, args.settings, uint64_t{8} << 30);
    paper_ = MakePaperGatherer(input_, paper, args.paper_tracing);
  }

  Outcome Run() {
    Outcome outcome;
    const fs::path folder = fs::temp_directory_path() / ("glint-benchmark-" + std::to_string(getpid()));
    fs::remove_all(folder);
    ChunkStore store = *ChunkStore::Open(folder);
    std::optional<Layer> previous;
    for (int layer = 0; layer < args_.layers; ++layer) {
      const LayerViews* views = previous ? &previous->views : nullptr;
      const std::vector<TaskSpec> tasks = Tasks(layer);
      const double packing = ThreadSeconds();
      shared_->BeginLayer(layer, views, 1);
      outcome.shared.cpu_seconds += ThreadSeconds() - packing;
      for (Gatherer* other : {paper_.get(), truth_[0].get(), truth_[1].get()})
        other->BeginLayer(layer, views, threads_);
      RunLayer(tasks, &store, &outcome);
      if (args_.slices > 0) MeasureErrors(layer, &outcome);
      Result<Layer> merged =
          MergeLayer(store, tasks, domain_, grid_, args_.settings, kDefaultTableForm, threads_);
      if (!merged.ok()) {
        std::fprintf(stderr, "merge failed: %s\n", merged.status().message().c_str());
        std::exit(1);
      }
      outcome.energy.push_back(merged->energy);
      outcome.density.push_back(merged->views.specular[0].density());
      previous.emplace(std::move(merged.value()));
    }
    fs::remove_all(folder);
    return outcome;
  }

  const BakeDomain& domain() const { return domain_; }

 private:
  std::vector<TaskSpec> Tasks(int layer) const {
    constexpr uint32_t kStep = 128;
    std::vector<TaskSpec> tasks;
    for (uint32_t v = 0; v < domain_.vertex_count(); v += kStep) {
      const GatherBlock block{v, std::min(kStep, domain_.vertex_count() - v), 0, grid_.size()};
      tasks.push_back({Hasher().Add(layer).Add(v).Finish(), layer, block});
    }
    return tasks;
  }

  void RunLayer(const std::vector<TaskSpec>& tasks, ChunkStore* store, Outcome* outcome) {
    std::mutex mutex;
    uint64_t paper_vertices = 0;
    SchemeResult paper_sample;
    ParallelFor(tasks.size(), threads_, 1, [&](size_t i, int) {
      const double t0 = ThreadSeconds();
      const BlockResult shared = shared_->Gather(tasks[i].block);
      const double t1 = ThreadSeconds();
      const bool both = args_.paper_every > 0;
      GatherBlock part = tasks[i].block;
      GatherCounters counters;
      if (both) {
        const uint32_t every = static_cast<uint32_t>(args_.paper_every), whole = part.vertices;
        part.vertices = std::max(1u, whole / every);
        part.first_vertex +=
            CounterRng(args_.settings.seed, static_cast<uint32_t>(i)).Bits() % (whole - part.vertices + 1);
        counters = paper_->Gather(part).counters;
      }
      const double t2 = ThreadSeconds();
      if (!store->PutResult(tasks[i].key, SerializeBlock(shared)).ok()) std::abort();
      const std::lock_guard lock(mutex);
      outcome->shared.cpu_seconds += t1 - t0;
      outcome->shared.rays += shared.counters.rays;
      outcome->shared.slices += shared.counters.slices;
      if (!both) return;
      paper_sample.cpu_seconds += t2 - t1;
      paper_sample.rays += counters.rays;
      paper_sample.slices += counters.slices;
      paper_vertices += part.vertices;
    });
    if (paper_vertices == 0) return;
    const double scale = static_cast<double>(domain_.vertex_count()) / static_cast<double>(paper_vertices);
    outcome->paper.cpu_seconds += paper_sample.cpu_seconds * scale;
    outcome->paper.rays += static_cast<uint64_t>(static_cast<double>(paper_sample.rays) * scale);
    outcome->paper.slices += static_cast<uint64_t>(static_cast<double>(paper_sample.slices) * scale);
  }

  SliceValue Evaluate(Gatherer* gatherer, uint32_t v, uint32_t column, int slot, int layer,
                      const Vmf& brdf) const {
    const BlockResult result = gatherer->Gather({v, 1, column, 1});
    const BlockRows& rows = result.slots[slot];
    if (rows.columns.empty()) return layer == 0 ? SliceValue{1, brdf} : SliceValue{0, brdf};
    if (layer == 0) {
      const DirectLobe lobe = DecodeDirect(rows.entries.data());
      const glm::vec3 mu = brdf.mu + lobe.shift;
      return {lobe.fraction,
              {glm::length(mu) > 0 ? glm::normalize(mu) : brdf.mu, brdf.kappa * lobe.kappa_ratio}};
    }
    const IndirectLobe lobe = DecodeIndirect(rows.entries.data());
    return {Luminance(lobe.alpha), {lobe.mu, lobe.kappa}};
  }

  void MeasureErrors(int layer, Outcome* outcome) {
    ErrorSums shared, paper;
    std::vector<std::array<double, 4>> terms(args_.slices, {0, 0, 0, 0});
    std::vector<uint8_t> counted(args_.slices, 0);
    ParallelFor(terms.size(), threads_, 1, [&](size_t i, int) {
      CounterRng rng(args_.settings.seed, static_cast<uint32_t>(i), static_cast<uint32_t>(layer),
                     0x42656E63u);
      const uint32_t v = rng.Bits() % domain_.vertex_count(), column = rng.Bits() % grid_.size();
      const glm::vec3& wo = grid_.direction(column);
      if (glm::dot(wo, domain_.normals[v]) <= 0) return;
      const SliceSampler& sampler = samplers_[domain_.shape[v]];
      const UnoccludedSlice slice(sampler, domain_.normals[v], wo);
      const int slot = static_cast<int>(rng.Bits() % static_cast<uint32_t>(slice.lobes.lobes));
      const BrdfLobe seen = slice.Seen(sampler, slot);
      const Vmf brdf{slice.Direction(seen), seen.kappa};
      const SliceValue s = Evaluate(truth_[0].get(), v, column, slot, layer, brdf);
      const SliceValue t = Evaluate(truth_[1].get(), v, column, slot, layer, brdf);
      const SliceValue a = Evaluate(shared_.get(), v, column, slot, layer, brdf);
      const SliceValue b = Evaluate(paper_.get(), v, column, slot, layer, brdf);
      const double norm = VmfInnerProduct(brdf, brdf);
      auto distance = [](const SliceValue& x, const SliceValue& y) {
        return static_cast<double>(VmfDistance2(x.alpha, x.lobe, y.alpha, y.lobe));
      };
      auto l2 = [&](const SliceValue& x) {
        return 0.5 * (distance(x, s) + distance(x, t) - distance(s, t)) / norm;
      };
      auto alpha = [&](const SliceValue& x) {
        return static_cast<double>((x.alpha - s.alpha) * (x.alpha - t.alpha));
      };
      terms[i] = {l2(a), l2(b), alpha(a), alpha(b)};
      counted[i] = 1;
    });
    for (size_t i = 0; i < terms.size(); ++i) {
      if (!counted[i]) continue;
      shared.l2 += terms[i][0], paper.l2 += terms[i][1];
      shared.alpha += terms[i][2], paper.alpha += terms[i][3];
      ++shared.count, ++paper.count;
    }
    outcome->shared.errors.push_back(shared);
    outcome->paper.errors.push_back(paper);
  }

  const Arguments& args_;
  const int threads_;
  const BakeDomain domain_;
  const DirectionGrid grid_;
  const RayScene rays_;
  const GatherInput input_;
  std::vector<SliceSampler> samplers_;
  std::unique_ptr<Gatherer> shared_, paper_, truth_[2];
};

double WallSeconds(const Scene& scene, const std::string& name, const Arguments& args) {
  const fs::path out = fs::temp_directory_path() / ("glint-benchmark-" + std::to_string(getpid()) + ".glint");
  BakeOptions options;
  options.settings = args.settings;
  options.threads = args.threads;
  options.max_layers = args.layers - 1;
  options.layer_tolerance = 0;
  const auto begin = std::chrono::steady_clock::now();
  const Result<BakeReport> report = BakeScene(scene, name, out, options);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!report.ok()) std::fprintf(stderr, "bake failed: %s\n", report.status().message().c_str());
  fs::remove(out);
  fs::remove(out.string() + ".json");
  return seconds;
}

Arguments Parse(int argc, char** argv) {
  Arguments args;
  for (int i = 1; i < argc; ++i) {
    const std::string key = argv[i];
    if (key == "--wall") {
      args.wall = true;
      continue;
    }
    if (key == "--paper-one-by-one") {
      args.paper_tracing = PaperTracing::kOneByOne;
      continue;
    }
    if (i + 1 >= argc) {
      std::fprintf(stderr, "%s wants a value\n", key.c_str());
      std::exit(2);
    }
    const std::string value = argv[++i];
    if (key == "--scenes") {
      args.scenes = Split(value);
    } else if (key == "--exponents") {
      args.exponents.clear();
      for (const std::string& e : Split(value)) args.exponents.push_back(std::stof(e));
    } else if (key == "--vertices") {
      args.vertices = static_cast<uint32_t>(std::stoul(value));
    } else if (key == "--layers") {
      args.layers = std::stoi(value);
    } else if (key == "--paper-every") {
      args.paper_every = std::stoi(value);
    } else if (key == "--slices") {
      args.slices = std::stoi(value);
    } else if (key == "--truth-rays") {
      args.truth_rays = std::stoi(value);
    } else if (key == "--threads") {
      args.threads = std::stoi(value);
    } else if (key == "--rays-per-kappa") {
      args.settings.rays_per_kappa = std::stof(value);
    } else if (key == "--split") {
      args.settings.split_levels = std::clamp(std::stoi(value), 0, 2);
    } else if (key == "--json") {
      args.json = value;
    } else {
      std::fprintf(stderr, "unknown option %s\n", key.c_str());
      std::exit(2);
    }
  }
  return args;
}

nlohmann::ordered_json ToJson(const SchemeResult& r) {
  nlohmann::ordered_json json = {{"cpu_seconds", r.cpu_seconds}, {"rays", r.rays}, {"slices", r.slices}};
  for (const ErrorSums& e : r.errors)
    json["errors"].push_back({{"rms_l2", e.rms_l2()}, {"rms_alpha", e.rms_alpha()}});
  return json;
}

int Main(int argc, char** argv) {
  const Arguments args = Parse(argc, argv);
  nlohmann::ordered_json rows;
  std::printf(
      "%-8s %5s %8s %9s %9s %7s %8s %8s  layer: rms L2 / rms alpha, default | paper (density, light)\n",
      "scene", "n", "vertices", "default s", "paper s", "ratio", "Mrays", "Mrays p.");
  for (const std::string& name : args.scenes)
    for (const float exponent : args.exponents) {
      const Result<Scene> scene = GenerateScene(name, {args.vertices, exponent});
      if (!scene.ok()) {
        std::fprintf(stderr, "%s\n", scene.status().message().c_str());
        return 2;
      }
      Contest contest(*scene, args);
      Outcome outcome = contest.Run();
      if (args.wall) outcome.wall_seconds = WallSeconds(*scene, name, args);
      std::printf("%-8s %5.0f %8u %9.2f %9.1f %7.1f %8.1f %8.1f ", name.c_str(), exponent,
                  contest.domain().vertex_count(), outcome.shared.cpu_seconds, outcome.paper.cpu_seconds,
                  outcome.paper.cpu_seconds / outcome.shared.cpu_seconds,
                  1e-6 * static_cast<double>(outcome.shared.rays),
                  1e-6 * static_cast<double>(outcome.paper.rays));
      for (size_t i = 0; i < outcome.shared.errors.size(); ++i)
        std::printf(" %zu: %.4f/%.4f | %.4f/%.4f (%.0f%%, %.3f)", i, outcome.shared.errors[i].rms_l2(),
                    outcome.shared.errors[i].rms_alpha(), outcome.paper.errors[i].rms_l2(),
                    outcome.paper.errors[i].rms_alpha(), 100 * outcome.density[i], outcome.energy[i]);
      if (args.wall) std::printf("  whole bake %.1f s wall", outcome.wall_seconds);
      std::printf("\n");
      std::fflush(stdout);
      rows.push_back({{"scene", name},
                      {"exponent", exponent},
                      {"vertices", contest.domain().vertex_count()},
                      {"default", ToJson(outcome.shared)},
                      {"paper", ToJson(outcome.paper)},
                      {"wall_seconds", outcome.wall_seconds},
                      {"energy", outcome.energy},
                      {"density", outcome.density}});
    }
  if (!args.json.empty()) std::ofstream(args.json) << rows.dump(1) << "\n";
  return 0;
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) { return glint::Main(argc, argv); }
