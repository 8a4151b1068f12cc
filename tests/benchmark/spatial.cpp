// Bakes of chosen vertices beside bakes of every vertex: vertices, processor time, bytes, and the estimate of
// the error with its causes. Prints the table of docs/adaptive.md.
//
//   glint_benchmark_spatial SCENE... [--vertices 12000] [--exponent 0] [--directions 162] [--layers 2]
//                           [--tolerances 0,0.2,0.1] [--subdivide 0] [--slices 1000] [--threads N]
//
// SCENE: a glTF file, or the name of a generated one; with an exponent, a file's materials all become Phong.
// Tolerance 0: every vertex. With --subdivide N, faces are also split evenly, 1 to N times.

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "common/archive/archive.h"
#include "common/domain/direction_grid.h"
#include "common/scene/generate.h"
#include "common/scene/load.h"
#include "coordinator/bake.h"
#include "coordinator/error_estimate.h"
#include "tests/benchmark/benchmark_support.h"
#include "tests/benchmark/phong.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> scenes;
  std::vector<float> tolerances = {0, 0.2f, 0.1f};
  int subdivide = 0;
  uint32_t vertices = 12000, slices = 1000;
  float exponent = 0;
  BakeOptions bake;
};

void Run(const Scene& scene, const std::string& name, const BakeOptions& options, uint32_t slices) {
  const fs::path path = fs::temp_directory_path() / ("glint-spatial-" + std::to_string(getpid()) + ".glint");
  const double begin = CpuSeconds();
  const BakeReport report = Need(BakeScene(scene, name, path, options));
  const double baked = CpuSeconds();
  const Archive archive = Need(Archive::Open(path));
  const RayScene rays(scene);
  const ErrorEstimate estimate =
      Need(EstimateError(archive.domain(), rays, archive.MakeGrid(), archive.layers(),
                         {slices, options.settings.seed, options.settings.read_out(), options.threads}));
  std::printf("| %s | %g | %d | %llu | %llu | %llu | %.1f | %.2f | %.3f +- %.3f |", name.c_str(),
              options.settings.spatial_tolerance, options.settings.subdivide,
              static_cast<unsigned long long>(report.vertices),
              static_cast<unsigned long long>(report.refinement ? report.refinement->tested : 0),
              static_cast<unsigned long long>(report.baked_vertices), baked - begin,
              1e-6 * static_cast<double>(report.archive_bytes), estimate.all.rms, estimate.all.uncertainty);
  for (const double cause : estimate.all.cause) std::printf(" %.3f |", cause);
  std::printf("\n");
  std::fflush(stdout);
  fs::remove(path);
  fs::remove(path.string() + ".json");
}

Arguments Parse(int argc, char** argv) {
  Arguments args;
  args.bake.max_layers = 2;
  args.bake.estimate_slices = 0;
  args.bake.settings.grid_level = DirectionGrid::LevelOf(162);
  const Options options = {
      {"--vertices", Set(&args.vertices)},
      {"--exponent", Set(&args.exponent)},
      {"--directions",
       [&](const std::string& value) {
         args.bake.settings.grid_level = DirectionGrid::LevelOf(static_cast<uint32_t>(std::stoul(value)));
       }},
      {"--layers", Set(&args.bake.max_layers)},
      {"--tolerances", [&](const std::string& value) { args.tolerances = Numbers(value); }},
      {"--subdivide", Set(&args.subdivide)},
      {"--slices", Set(&args.slices)},
      {"--threads", Set(&args.bake.threads)},
  };
  args.scenes = ReadOptions(argc, argv, options);
  return args;
}

void RunScene(const std::string& word, const Arguments& args) {
  const bool file = fs::exists(word);
  Scene scene = Need(file ? LoadScene(word) : GenerateScene(word, {args.vertices, args.exponent}));
  if (file) MakePhong(args.exponent, &scene);
  const std::string name = fs::path(word).stem().string();
  BakeOptions options = args.bake;
  for (const float tolerance : args.tolerances) {
    options.settings.spatial_tolerance = tolerance;
    Run(scene, name, options, args.slices);
  }
  options.settings.spatial_tolerance = 0;
  for (options.settings.subdivide = 1; options.settings.subdivide <= args.subdivide;
       ++options.settings.subdivide)
    Run(scene, name, options, args.slices);
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) {
  const glint::Arguments args = glint::Parse(argc, argv);
  std::printf("| scene | tolerance | split | vertices | tested | baked | bake, CPU s | MB | estimate |");
  for (const char* cause : glint::kErrorCauseNames) std::printf(" %s |", cause);
  std::printf("\n|---|---|---|---|---|---|---|---|---|");
  for (int c = 0; c < glint::kErrorCauses; ++c) std::printf("---|");
  std::printf("\n");
  for (const std::string& scene : args.scenes) glint::RunScene(scene, args);
  return 0;
}
