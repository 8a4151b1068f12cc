// What leaving directions out costs and saves: scenes are baked on uniform and on nested grids of view
// directions, and their archives' errors estimated. Prints the table of docs/adaptive.md.
//
//   glint_benchmark_angular [--scenes teapot,goblets] [--exponents 32,128,512] [--vertices 5000] [--layers 2]
//                           [--grids 162,642,2562,2562:0.1:42] [--slices 800] [--threads 1]
//
// A scene is one of glint's own, or a .glb or .gltf file, which keeps its materials whatever the exponents
// are. A grid is DIRECTIONS, or DIRECTIONS:TOLERANCE:BASE as for --directions, --angular-tolerance and
// --base-directions of glint bake.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "common/archive/archive.h"
#include "common/scene/generate.h"
#include "common/scene/load.h"
#include "coordinator/bake.h"
#include "coordinator/error_estimate.h"
#include "tests/benchmark/benchmark_support.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> scenes = {"teapot", "goblets"}, grids = {"162", "642", "2562", "2562:0.1:42"};
  std::vector<float> exponents = {32, 128, 512};
  uint32_t vertices = 5000, slices = 800;
  BakeOptions bake;
};

int LevelOf(const std::string& directions) {
  const int level = DirectionGrid::LevelOf(static_cast<uint32_t>(std::stoul(directions)));
  if (level >= 0) return level;
  std::fprintf(stderr, "%s: no grid has that many directions\n", directions.c_str());
  std::exit(2);
}

BakeSettings WithGrid(BakeSettings settings, const std::string& grid) {
  const std::vector<std::string> part = Split(grid, ':');
  settings.grid_level = LevelOf(part.at(0));
  if (part.size() > 1) settings.angular_tolerance = std::stof(part[1]);
  if (part.size() > 2) settings.base_level = LevelOf(part[2]);
  return settings;
}

void Run(const Scene& scene, const std::string& name, float exponent, const std::string& grid,
         const Arguments& args) {
  BakeOptions options = args.bake;
  options.settings = WithGrid(options.settings, grid);
  const fs::path path = fs::temp_directory_path() / ("glint-angular-" + std::to_string(getpid()) + ".glint");
  const double begin = CpuSeconds();
  const BakeReport report = Need(BakeScene(scene, name, path, options));
  const double seconds = CpuSeconds() - begin;
  const Archive archive = Need(Archive::Open(path));
  const ErrorEstimate error =
      Need(EstimateError(archive.domain(), RayScene(scene), archive.MakeGrid(), archive.layers(),
                         {args.slices, options.settings.seed, options.settings.read_out(), options.threads}));
  uint64_t stored = 0;
  for (const LayerViews& layer : archive.layers())
    for (const SliceTableView& table : layer.specular) stored += table.entries();
  std::printf("| %s | %g | %s | %.2f | %.2f | %.0f | %.4f +- %.4f | %.3f |", name.c_str(), exponent,
              grid.c_str(), seconds, 1e-6 * static_cast<double>(report.archive_bytes),
              static_cast<double>(stored) / archive.domain().vertex_count(), error.all.rms,
              error.all.uncertainty, error.all.cause[static_cast<size_t>(ErrorCause::kAngular)]);
  for (const auto& layer : error.layers) std::printf(" %.4f", layer.rms);
  std::printf(" |\n");
  std::fflush(stdout);
  fs::remove(path);
  fs::remove(path.string() + ".json");
}

void RunGrids(const Scene& scene, const std::string& name, float exponent, const Arguments& args) {
  for (const std::string& grid : args.grids) Run(scene, name, exponent, grid, args);
}

Arguments Parse(int argc, char** argv) {
  Arguments args;
  args.bake.max_layers = 2;
  args.bake.estimate_slices = 0;
  args.bake.threads = 1;
  const Options options = {
      {"--scenes", [&](const std::string& value) { args.scenes = Split(value); }},
      {"--exponents", [&](const std::string& value) { args.exponents = Numbers(value); }},
      {"--grids", [&](const std::string& value) { args.grids = Split(value); }},
      {"--vertices", Set(&args.vertices)},
      {"--layers", Set(&args.bake.max_layers)},
      {"--slices", Set(&args.slices)},
      {"--threads", Set(&args.bake.threads)},
  };
  ReadOnlyOptions(argc, argv, options);
  return args;
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) {
  using namespace glint;  // NOLINT: a program, not a header
  const Arguments args = Parse(argc, argv);
  std::printf(
      "| scene | exponent | directions | CPU s | MB | entries a vertex | error | angular | layers |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  for (const std::string& name : args.scenes) {
    if (const fs::path path(name); path.has_extension()) {
      RunGrids(Need(LoadScene(path, {})), path.stem(), 0, args);
      continue;
    }
    for (const float exponent : args.exponents)
      RunGrids(Need(GenerateScene(name, {args.vertices, exponent})), name, exponent, args);
  }
  return 0;
}
