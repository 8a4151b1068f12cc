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
// above 1 stands for the error of the uniform bake of so many directions.

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
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

namespace glint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> scenes, uniform = {"42", "162", "642", "2562", "162:1", "642:1"};
  std::vector<float> exponents = {0}, tolerances = {642};
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
  for (const auto& round : json["target"]["rounds"]) {
    std::printf(
        "<!-- round: error %.4f, %.1f s, %.2f MB, spatial %g, level %d, angular %g, rays %g, lobes %d, "
        "drop %g; %s: %s -->\n",
        round["error"].get<double>(), round["seconds"].get<double>(), 1e-6 * round["bytes"].get<double>(),
        round["settings"]["spatial_tolerance"].get<double>(), round["settings"]["grid_level"].get<int>(),
        round["settings"]["angular_tolerance"].get<double>(),
        round["settings"]["rays_per_kappa"].get<double>(), round["settings"]["slice_lobes"].get<int>(),
        round["settings"]["drop"].get<double>(), round["kept"].get<bool>() ? "kept" : "dropped",
        round["cause"].dump().c_str());
    if (round["kept"].get<bool>()) found = Need(SettingsFromJson(round["settings"]));
  }
  std::printf("<!-- %s -->\n", json["target"]["ended"].get<std::string>().c_str());
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

/// y at x on the lower border of points (falling, straight between them in logarithms); beyond their ends,
/// the end's.
double OnFrontier(std::vector<std::pair<double, double>> points, double x) {
  std::sort(points.begin(), points.end());
  std::vector<std::pair<double, double>> border;
  for (const auto& p : points)
    if (border.empty() || p.second < border.back().second) border.push_back(p);
  for (size_t i = 0; i < border.size(); ++i) {
    const auto& [x1, y1] = border[i];
    if (x1 < x && i + 1 < border.size()) continue;
    if (i == 0 || x1 < x) return y1;
    const auto& [x0, y0] = border[i - 1];
    return y0 * std::pow(y1 / y0, std::log(x / x0) / std::log(x1 / x0));
  }
  return 0;
}

/// What uniform bakes would take for the same error, and come to with the same bytes.
void Compare(const std::vector<Bake>& uniform, const Bake& bake) {
  std::vector<std::pair<double, double>> bytes, seconds, errors;
  for (const Bake& u : uniform) {
    bytes.emplace_back(u.error.all.rms, u.bytes);
    seconds.emplace_back(u.error.all.rms, u.seconds);
    errors.emplace_back(u.bytes, u.error.all.rms);
  }
  const double error = bake.error.all.rms;
  const double equal_bytes = OnFrontier(bytes, error), equal_seconds = OnFrontier(seconds, error);
  std::printf("<!-- equal error: %.2f MB (%.1f x), %.1f s (%.1f x); equal bytes: error %.4f (%.2f x) -->\n",
              1e-6 * equal_bytes, equal_bytes / bake.bytes, equal_seconds, equal_seconds / bake.seconds,
              OnFrontier(errors, bake.bytes), OnFrontier(errors, bake.bytes) / error);
  std::fflush(stdout);
}

Scene MakeScene(const std::string& word, float exponent, const Arguments& args) {
  Scene scene = Need(fs::exists(word) ? LoadScene(word) : GenerateScene(word, {args.vertices, 0}));
  if (exponent <= 0) return scene;
  for (Material& material : scene.materials) {
    material.model = MaterialModel::kPhong;
    material.exponent = exponent;
    material.specular = 0.9f * material.base_color;
  }
  scene.content = HashScene(scene);
  return scene;
}

void RunScene(const std::string& word, float exponent, const Arguments& args) {
  const Scene scene = MakeScene(word, exponent, args);
  const std::string name = fs::path(word).stem().string();
  std::vector<Bake> uniform;
  for (const std::string& grid : args.uniform) {
    uniform.push_back(BakeUniform(scene, grid, args));
    Print(name, exponent, uniform.back(), uniform.back().seconds);
  }
  for (const float tolerance : args.tolerances) {
    float wanted = tolerance;
    for (const Bake& u : uniform)
      if (tolerance > 1 && u.name == std::to_string(static_cast<int>(tolerance)))
        wanted = static_cast<float>(u.error.all.rms);
    double search = 0;
    const Bake bake = BakeToTolerance(scene, wanted, args, &search);
    Print(name, exponent, bake, search);
    if (!uniform.empty()) Compare(uniform, bake);
  }
}

std::vector<float> Numbers(const std::string& list) {
  std::vector<float> numbers;
  for (const std::string& part : Split(list)) numbers.push_back(std::stof(part));
  return numbers;
}

Arguments Parse(int argc, char** argv) {
  Arguments args;
  args.bake.max_layers = 2;
  args.bake.estimate_slices = 0;
  args.bake.threads = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string key = argv[i];
    if (key.rfind("--", 0) != 0) {
      args.scenes.push_back(key);
      continue;
    }
    const std::string value = i + 1 < argc ? argv[++i] : "";
    if (key == "--exponents") {
      args.exponents = Numbers(value);
    } else if (key == "--tolerances") {
      args.tolerances = Numbers(value);
    } else if (key == "--uniform") {
      args.uniform = Split(value);
    } else if (key == "--vertices") {
      args.vertices = static_cast<uint32_t>(std::stoul(value));
    } else if (key == "--layers") {
      args.bake.max_layers = std::stoi(value);
    } else if (key == "--slices") {
      args.slices = static_cast<uint32_t>(std::stoul(value));
    } else if (key == "--max-seconds") {
      args.bake.target.max_seconds = std::stod(value);
    } else if (key == "--threads") {
      args.bake.threads = std::stoi(value);
    } else {
      std::fprintf(stderr, "unknown option %s\n", key.c_str());
      std::exit(2);
    }
  }
  return args;
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) {
  const glint::Arguments args = glint::Parse(argc, argv);
  std::printf("| scene | exponent | bake | vertices | level | lobes | CPU s | search, CPU s | MB | error |");
  for (const char* cause : glint::kErrorCauseNames) std::printf(" %s |", cause);
  std::printf("\n|---|---|---|---|---|---|---|---|---|---|");
  for (int c = 0; c < glint::kErrorCauses; ++c) std::printf("---|");
  std::printf("\n");
  for (const std::string& scene : args.scenes)
    for (const float exponent : args.exponents) glint::RunScene(scene, exponent, args);
  return 0;
}
