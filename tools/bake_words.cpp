#include "tools/bake_words.h"

#include "common/domain/direction_grid.h"

namespace glint {
namespace {

/// 12, 42, 162, ...: what --directions may be.
std::string GridSizes() {
  std::string sizes;
  for (int level = 0, size = 12; level <= DirectionGrid::kMaxLevel; ++level, size = 4 * size - 6) {
    sizes += (level > 0 ? ", " : "") + std::to_string(size);
  }
  return sizes;
}

}  // namespace

void AddAccuracyWords(CLI::App& app, BakeOptions& options) {
  BakeSettings& settings = options.settings;
  const auto add = [&app](const char* word, auto& value, const std::string& help) {
    return app.add_option(word, value, help)->capture_default_str()->group("Accuracy and time");
  };
  BakeTarget& target = options.target;
  // What is asked for by name is not for the target to find.
  const auto fixes = [&target](BakeAxis axis) {
    return [&target, axis](const std::string&) { target.fixed[static_cast<size_t>(axis)] = true; };
  };
  add("--tolerance", target.tolerance,
      "Bake ever finer until the estimated relative error of relit pictures is at most this, refining what "
      "causes it; 0: as the other words say")
      ->check(NumberRange(0, 1))
      ->type_name("X");
  add("--max-seconds", target.max_seconds, "The best bake within this time; 0: any")
      ->check(NumberRange(0, kMaxTargetSeconds))
      ->type_name("S");
  add("--max-bytes", target.max_bytes, "The best archive within this size, such as 50MB; 0: any")
      ->transform(CLI::AsSizeValue(true))
      ->type_name("N");
  const auto choose_grid = [&settings](uint32_t directions) {
    settings.grid_level = DirectionGrid::LevelOf(directions);
    if (settings.grid_level >= 0) return;
    throw CLI::ValidationError("--directions", std::to_string(directions) + ": choose one of " + GridSizes());
  };
  app.add_option_function<uint32_t>("--directions", choose_grid, "View directions: one of " + GridSizes())
      ->each(fixes(BakeAxis::kDirections))
      ->default_str("642")
      ->type_name("N")
      ->group("Accuracy and time");
  add("--angular-tolerance", settings.angular_tolerance,
      "shared: leave out directions whose slices interpolation gives within this error, relative to the "
      "unoccluded ones; 0: none")
      ->check(NumberRange(0, 1e3))
      ->each(fixes(BakeAxis::kDirections))
      ->type_name("X");
  app.add_option_function<uint32_t>(
         "--base-directions",
         [&settings](uint32_t directions) {
           settings.base_level = DirectionGrid::LevelOf(directions);
           if (settings.base_level >= 0) return;
           throw CLI::ValidationError("--base-directions",
                                      std::to_string(directions) + ": choose one of " + GridSizes());
         },
         "With --angular-tolerance: directions that are never left out")
      ->default_str("42")
      ->type_name("N")
      ->group("Accuracy and time");
  add("--layers", options.max_layers, "Layers 0 to K: at most K indirect reflections")
      ->check(CLI::Range(0, kMaxIndirectLayers))
      ->type_name("K");
  add("--layer-tolerance", options.layer_tolerance,
      "No further layer once one carries less than this part of the light")
      ->check(NumberRange(0, 1))
      ->type_name("X");
  AddChoice<GatherMethod>(
      app, "--gather", settings.method, {{"shared", GatherMethod::kShared}, {"paper", GatherMethod::kPaper}},
      "shared (default): one set of rays per vertex; paper: the 2011 scheme, for comparison")
      ->group("Accuracy and time");
  add("--rays-per-kappa", settings.rays_per_kappa,
      "shared: rays per vertex and unit of its sharpest lobe's kappa, at kappa 128; they grow as kappa^(3/4)")
      ->check(NumberRange(0.01, 1e4))
      ->each(fixes(BakeAxis::kRays))
      ->type_name("X");
  add("--max-rays", settings.max_rays, "shared: at most this many rays per vertex")
      ->check(CLI::Range(settings.min_rays, 1 << 20))
      ->each(fixes(BakeAxis::kRays))
      ->type_name("N");
  add("--own-rays", settings.own_rays,
      "shared: rays of a slice's own, in each layer, where its lobe is too sharp for the vertex's; 0: none")
      ->check(CLI::Range(0, kMaxOwnRays))
      ->type_name("N");
  add("--paper-rays", settings.paper_rays, "paper: rays per slice and layer")
      ->check(CLI::Range(1, 1 << 20))
      ->each(fixes(BakeAxis::kRays))
      ->type_name("N");
  add("--lobes", settings.fit.max_lobes, "At most this many lobes for a material's highlight")
      ->check(CLI::Range(1, kMaxBrdfLobes))
      ->type_name("N");
  add("--fit-tolerance", settings.fit.tolerance,
      "No further lobe once the fit's relative error is below this")
      ->check(NumberRange(0, 1))
      ->type_name("X");
  add("--slice-lobes", settings.slice_lobes,
      "shared: a slice is stored as at most this many lobes for each of its material's")
      ->check(CLI::Range(1, kMaxSliceLobes))
      ->each(fixes(BakeAxis::kLobes))
      ->type_name("N");
  add("--lobe-tolerance", settings.lobe_tolerance,
      "shared: no further lobe of a slice for less than this error, relative to its light; of direct light, "
      "a "
      "tenth of it, relative to the unoccluded lobe")
      ->check(NumberRange(0, 1))
      ->type_name("X");
  add("--drop", settings.drop, "Leave out slices that change the light by less than this")
      ->check(NumberRange(0, 1))
      ->each(fixes(BakeAxis::kBits))
      ->type_name("X");
  add("--bits-tolerance", settings.bits_tolerance,
      "Store lobes with the fewest bits that change slices by less than this (rms); 0: 12 bytes each")
      ->check(NumberRange(0, 1))
      ->each(fixes(BakeAxis::kBits))
      ->type_name("X");
  add("--spatial-tolerance", settings.spatial_tolerance,
      "Vertices are baked, and edges halved, where predicting them is further off than this; 0: every vertex "
      "of the mesh is baked, and no other")
      ->check(NumberRange(0, 1))
      ->each(fixes(BakeAxis::kVertices))
      ->type_name("X");
  add("--smallest-edge", settings.smallest_edge,
      "No shorter edge comes from halving; part of the scene's diagonal")
      ->check(NumberRange(0, 1))
      ->each(fixes(BakeAxis::kVertices))
      ->type_name("X");
  add("--max-vertices", settings.max_vertices, "Bake at most so many vertices, worst first; 0: any number")
      ->each(fixes(BakeAxis::kVertices))
      ->type_name("N");
  add("--subdivide", settings.subdivide, "Split every face in four, N times, for comparison")
      ->check(CLI::Range(0, 8))
      ->each(fixes(BakeAxis::kVertices))
      ->type_name("N");
  app.add_option("--estimate", options.estimate_slices,
                 "Slices to test after the bake, which estimates its error; 0: none (default: one for 10 "
                 "vertices, 64 to 2048)")
      ->check(CLI::Range(0, kMaxEstimateSlices))
      ->type_name("N")
      ->group("Accuracy and time");
  add("--seed", settings.seed, "Seed of the random numbers")->type_name("N");
}

void AddTaskWords(CLI::App& app, BakeOptions& options) {
  const std::string group = "Machine";
  app.add_option("--vertices-per-task", options.vertices_per_task, "Size of tasks; 0: chosen")
      ->type_name("N")
      ->group(group);
  app.add_option("--directions-per-task", options.directions_per_task, "Size of tasks; 0: all directions")
      ->type_name("N")
      ->group(group);
  AddChoice<TableForm>(app, "--table", options.table_form,
                       {{"compact", TableForm::kCompact}, {"classic", TableForm::kClassic}},
                       "Form of the tables: compact (default) or classic")
      ->group(group);
}

}  // namespace glint
