// The error that a bake estimates of itself beside that of relit pictures: scenes are baked, their archives
// relit from all around under rotated environments, and compared with the path tracer on the same lobes.
// Prints the table of docs/error-estimate.md, which defines both errors.
//
//   glint_benchmark_error_estimate [--scenes teapot,goblets] [--exponents 0] [--vertices 3000] [--layers 2]
//                                  [--skies procedural:studio,procedural:sunset] [--views 8] [--size 96]
//                                  [--spp 128] [--slices N] [--threads N] [--slice-lobes N]
//                                  [--lobe-tolerance X]
//
// Exponent 0 keeps the scene's own materials. --slices: for an estimate of more slices than the bake's own.

#include "coordinator/error_estimate.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "common/archive/archive.h"
#include "common/render/environment.h"
#include "common/scene/generate.h"
#include "coordinator/bake.h"
#include "tests/benchmark/benchmark_support.h"
#include "tests/coordinator/relit_error.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> scenes = {"teapot", "goblets"};
  std::vector<float> exponents = {0};
  std::vector<std::string> skies = {"procedural:studio", "procedural:sunset"};
  uint32_t vertices = 3000;
  uint32_t slices = 0;
  RelitOptions relit;
  BakeOptions bake;
};

ErrorEstimate Estimate(const Scene& scene, const Archive& archive, const Arguments& args) {
  const RayScene rays(scene);
  EstimateOptions options;
  options.slices = args.slices > 0 ? args.slices : DefaultEstimateSlices(archive.domain().vertex_count());
  options.seed = args.bake.settings.seed;
  options.read_out = args.bake.settings.read_out();
  options.threads = args.bake.threads;
  return Need(EstimateError(archive.domain(), rays, archive.MakeGrid(), archive.layers(), options));
}

void PrintHead(const Arguments& args) {
  std::printf("| scene | exponent | vertices | slices | bake, CPU s | estimate, CPU s | estimate |");
  for (const std::string& sky : args.skies) std::printf(" %s |", fs::path(sky).stem().c_str());
  std::printf(" pictures | ratio |\n|---|---|---|---|---|---|---|");
  for (size_t i = 0; i < args.skies.size() + 2; ++i) std::printf("---|");
  std::printf("\n");
}

void Run(const std::string& name, float exponent, const Arguments& args) {
  const Scene scene = Need(GenerateScene(name, {args.vertices, exponent}));
  const fs::path path = fs::temp_directory_path() / ("glint-estimate-" + std::to_string(getpid()) + ".glint");
  const double begin = CpuSeconds();
  Need(BakeScene(scene, name, path, args.bake));
  const double baked = CpuSeconds();
  const Archive archive = Need(Archive::Open(path));
  const ErrorEstimate estimate = Estimate(scene, archive, args);
  std::printf("| %s | %g | %u | %u | %.2f | %.2f | %.3f +- %.3f |", name.c_str(), exponent,
              archive.domain().vertex_count(), estimate.slices, baked - begin, CpuSeconds() - baked,
              estimate.all.rms, estimate.all.uncertainty);
  double sum = 0;
  for (const std::string& sky : args.skies) {
    const double error = Need(RelitError(scene, archive, Need(Environment::Open(sky)), args.relit));
    sum += error * error / static_cast<double>(args.skies.size());
    std::printf(" %.3f |", error);
    std::fflush(stdout);
  }
  std::printf(" %.3f | %.2f |\n", std::sqrt(sum), estimate.all.rms / std::sqrt(sum));
  fs::remove(path);
  fs::remove(path.string() + ".json");
}

Arguments Parse(int argc, char** argv) {
  Arguments args;
  args.bake.max_layers = 2;
  args.bake.estimate_slices = 0;
  const Options options = {
      {"--scenes", [&](const std::string& value) { args.scenes = Split(value); }},
      {"--exponents", [&](const std::string& value) { args.exponents = Numbers(value); }},
      {"--skies", [&](const std::string& value) { args.skies = Split(value); }},
      {"--vertices", Set(&args.vertices)},
      {"--layers", Set(&args.bake.max_layers)},
      {"--views", Set(&args.relit.views)},
      {"--size", Set(&args.relit.size)},
      {"--spp", Set(&args.relit.samples)},
      {"--slice-lobes", Set(&args.bake.settings.slice_lobes)},
      {"--lobe-tolerance", Set(&args.bake.settings.lobe_tolerance)},
      {"--slices", Set(&args.slices)},
      {"--threads",
       [&](const std::string& value) { args.relit.threads = args.bake.threads = std::stoi(value); }},
  };
  ReadOnlyOptions(argc, argv, options);
  return args;
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) {
  const glint::Arguments args = glint::Parse(argc, argv);
  glint::PrintHead(args);
  for (const std::string& scene : args.scenes)
    for (const float exponent : args.exponents) glint::Run(scene, exponent, args);
  return 0;
}
