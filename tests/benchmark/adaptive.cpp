// Bakes to a tolerance beside uniform ones: one grid of directions, every vertex, the same rays, lobes and
// bits for all. Prints the tables of docs/adaptive.md: what each bake holds and takes, and what a uniform one
// of the same error, or of the same bytes, would.
//
//   glint_benchmark_adaptive SCENE... [--exponents 0] [--vertices 6000] [--layers 2] [--slices 2000]
//                            [--uniform 42,162,642,2562,162:1,642:1] [--tolerances 642] [--max-seconds 0]
//                            [--threads 1]
//
// SCENE: a glTF file, or the name of a generated one. With an exponent above 0 all materials become Phong
// with that exponent. A uniform bake is DIRECTIONS or DIRECTIONS:N, faces split in four N times. A tolerance
// is a number, or one of the uniform bakes, whose error it then is.

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/archive/archive.h"
#include "common/domain/direction_grid.h"
#include "common/round/settings_json.h"
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
  std::vector<std::string> scenes, uniform = {"42", "162", "642", "2562", "162:1", "642:1"},
                                   tolerances = {"642"};
  std::vector<float> exponents = {0};
  uint32_t vertices = 6000, slices = 2000;
  BakeOptions bake;
};

/// What a bake came to.
struct Bake {
  std::string name;
  uint32_t rows = 0;
  double directions = 0;  ///< stored in the fullest layer, for each row and slot
  double lobes = 0;       ///< stored in all, for each row
  double seconds = 0;     ///< of processor time
  double bytes = 0;
  ErrorEstimate error;
};

fs::path TemporaryPath() {
  return fs::temp_directory_path() / ("glint-adaptive-" + std::to_string(getpid()) + ".glint");
}

/// The archive at TemporaryPath(), which is removed.
Bake Measure(const std::string& name, const Scene& scene, const BakeSettings& settings,
             const Arguments& args) {
  const fs::path path = TemporaryPath();
  const Archive archive = Need(Archive::Open(path));
  Bake bake;
  bake.name = name;
  bake.rows = archive.domain().row_count();
  for (const LayerViews& layer : archive.layers()) {
    double first = 0;
    for (uint32_t lobe = 0; lobe < layer.lobes(); ++lobe) {
      for (uint32_t slot = 0; slot <= layer.diffuse_slot(); ++slot) {
        const auto entries = static_cast<double>(layer.table(lobe, slot).entries());
        bake.lobes += entries / bake.rows;
        if (lobe == 0 && slot < layer.diffuse_slot()) first += entries / bake.rows / layer.diffuse_slot();
      }
    }
    bake.directions = std::max(bake.directions, first);
  }
  bake.bytes = static_cast<double>(archive.file_bytes());
  bake.error = Need(EstimateError(archive.domain(), RayScene(scene), archive.MakeGrid(), archive.layers(),
                                  {args.slices, settings.seed, settings.read_out(), args.bake.threads}));
  fs::remove(path);
  fs::remove(path.string() + ".json");
  return bake;
}

/// Level of a uniform grid with so many directions above the horizon.
double AngularLevel(double directions) { return std::log2(std::max(directions * 2 - 2, 10.0) / 10) / 2; }

void Print(const std::string& scene, float exponent, const Bake& bake, double search) {
  std::printf("| %s | %g | %s | %u | %.1f | %.0f | %.1f | %.1f | %.2f | %.4f +- %.4f |", scene.c_str(),
              exponent, bake.name.c_str(), bake.rows, AngularLevel(bake.directions), bake.lobes, bake.seconds,
              search, 1e-6 * bake.bytes, bake.error.all.rms, bake.error.all.uncertainty);
}

void PrintCauses(const Bake& bake) {
  for (const double cause : bake.error.all.cause) std::printf(" %.3f |", cause);
  std::printf("\n");
  std::fflush(stdout);
}

Bake BakeUniform(const Scene& scene, const std::string& grid, const Arguments& args) {
  const std::vector<std::string> part = Split(grid, ':');
  BakeOptions options = args.bake;
  options.target = {};
  options.settings.grid_level = DirectionGrid::LevelOf(static_cast<uint32_t>(std::stoul(part.at(0))));
  options.settings.subdivide = part.size() > 1 ? std::stoi(part[1]) : 0;
  options.settings.bits_tolerance = 0;
  const double begin = CpuSeconds();
  Need(BakeScene(scene, "scene", TemporaryPath(), options));
  const double seconds = CpuSeconds() - begin;
  Bake bake = Measure(grid, scene, options.settings, args);
  bake.seconds = seconds;
  return bake;
}

/// The settings that a target's bake ended with, by its report.
BakeSettings FoundSettings(const BakeReport& report) {
  const auto json = nlohmann::ordered_json::parse(report.json);
  BakeSettings found;
  for (const auto& round : json["target"]["rounds"])
    if (round["kept"].get<bool>()) found = Need(SettingsFromJson(round["settings"]));
  return found;
}

/// @param search  seconds of all rounds together
Bake BakeToTolerance(const Scene& scene, float tolerance, const Arguments& args, double* search) {
  BakeOptions options = args.bake;
  options.target.tolerance = tolerance;
  options.estimate_slices.reset();
  double begin = CpuSeconds();
  options.settings = FoundSettings(Need(BakeScene(scene, "scene", TemporaryPath(), options)));
  *search = CpuSeconds() - begin;
  options.target = {};
  options.estimate_slices = 0;
  options.layer_tolerance = std::min(options.layer_tolerance, tolerance / 4);
  begin = CpuSeconds();
  Need(BakeScene(scene, "scene", TemporaryPath(), options));
  const double seconds = CpuSeconds() - begin;
  char name[32];
  std::snprintf(name, sizeof name, "X %.3f", tolerance);
  Bake bake = Measure(name, scene, options.settings, args);
  bake.seconds = seconds;
  return bake;
}

/// y at x on the lower convex border of points, in logarithms; beyond its ends, the end's.
double OnFrontier(std::vector<std::pair<double, double>> points, double x) {
  for (auto& [px, py] : points) px = std::log(px), py = std::log(py);
  std::sort(points.begin(), points.end());
  std::vector<std::pair<double, double>> border;
  const auto is_above = [&border](const std::pair<double, double>& next) {
    const auto& [x0, y0] = border[border.size() - 2];
    const auto& [x1, y1] = border.back();
    return (y1 - y0) * (next.first - x0) >= (next.second - y0) * (x1 - x0);
  };
  for (const auto& p : points) {
    if (!border.empty() && p.second >= border.back().second) continue;
    while (border.size() > 1 && is_above(p)) border.pop_back();
    border.push_back(p);
  }
  if (border.empty()) return NAN;
  x = std::log(x);
  size_t i = 0;
  while (i < border.size() && border[i].first < x) ++i;
  if (i == 0) return std::exp(border.front().second);
  if (i == border.size()) return std::exp(border.back().second);
  const auto& [x0, y0] = border[i - 1];
  const auto& [x1, y1] = border[i];
  return std::exp(y0 + (y1 - y0) * (x - x0) / (x1 - x0));
}

/// Columns: what uniform bakes would take for the same error, and come to with the same bytes.
void PrintRivals(const std::vector<Bake>& uniform, const Bake& bake) {
  std::vector<std::pair<double, double>> bytes, seconds, errors;
  for (const Bake& u : uniform) {
    bytes.emplace_back(u.error.all.rms, u.bytes);
    seconds.emplace_back(u.error.all.rms, u.seconds);
    errors.emplace_back(u.bytes, u.error.all.rms);
  }
  const double error = bake.error.all.rms, equal_bytes = OnFrontier(bytes, error),
               equal_seconds = OnFrontier(seconds, error);
  std::printf(" %.2f (%.1f x) | %.1f (%.1f x) | %.4f |", 1e-6 * equal_bytes, equal_bytes / bake.bytes,
              equal_seconds, equal_seconds / bake.seconds, OnFrontier(errors, bake.bytes));
}

Scene MakeScene(const std::string& word, float exponent, const Arguments& args) {
  Scene scene = Need(fs::exists(word) ? LoadScene(word) : GenerateScene(word, {args.vertices, 0}));
  MakePhong(exponent, &scene);
  return scene;
}

/// What a word of --tolerances stands for.
float Wanted(const std::string& tolerance, const std::vector<Bake>& uniform) {
  for (const Bake& u : uniform)
    if (u.name == tolerance) return static_cast<float>(u.error.all.rms);
  const float number = Numbers(tolerance).at(0);
  if (number <= 1) return number;
  std::fprintf(stderr, "--tolerances %s: is not among the uniform bakes\n", tolerance.c_str());
  std::exit(2);
}

void RunScene(const std::string& word, float exponent, const Arguments& args) {
  const Scene scene = MakeScene(word, exponent, args);
  const std::string name = fs::path(word).stem().string();
  std::vector<Bake> uniform;
  for (const std::string& grid : args.uniform) {
    uniform.push_back(BakeUniform(scene, grid, args));
    Print(name, exponent, uniform.back(), uniform.back().seconds);
    std::printf(" | | |");
    PrintCauses(uniform.back());
  }
  for (const std::string& tolerance : args.tolerances) {
    double search = 0;
    const Bake bake = BakeToTolerance(scene, Wanted(tolerance, uniform), args, &search);
    Print(name, exponent, bake, search);
    PrintRivals(uniform, bake);
    PrintCauses(bake);
  }
}

Arguments Parse(int argc, char** argv) {
  Arguments args;
  args.bake.max_layers = 2;
  args.bake.estimate_slices = 0;
  args.bake.threads = 1;
  const Options options = {
      {"--exponents", [&](const std::string& value) { args.exponents = Numbers(value); }},
      {"--tolerances", [&](const std::string& value) { args.tolerances = Split(value); }},
      {"--uniform", [&](const std::string& value) { args.uniform = Split(value); }},
      {"--vertices", Set(&args.vertices)},
      {"--layers", Set(&args.bake.max_layers)},
      {"--slices", Set(&args.slices)},
      {"--max-seconds", Set(&args.bake.target.max_seconds)},
      {"--threads", Set(&args.bake.threads)},
  };
  args.scenes = ReadOptions(argc, argv, options);
  return args;
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) {
  const glint::Arguments args = glint::Parse(argc, argv);
  std::printf(
      "| scene | exponent | bake | vertices | level | lobes | CPU s | search, CPU s | MB | error | uniform "
      "of equal "
      "error: MB | CPU s | of equal bytes: error |");
  for (const char* cause : glint::kErrorCauseNames) std::printf(" %s |", cause);
  std::printf("\n|---|---|---|---|---|---|---|---|---|---|---|---|---|");
  for (int c = 0; c < glint::kErrorCauses; ++c) std::printf("---|");
  std::printf("\n");
  for (const std::string& scene : args.scenes)
    for (const float exponent : args.exponents) glint::RunScene(scene, exponent, args);
  return 0;
}
