#include <unistd.h>

#include <cstdio>
#include <memory>

#include "common/base/log.h"
#include "common/domain/direction_grid.h"
#include "coordinator/bake.h"
#include "tools/commands.h"

namespace glint {
namespace {

struct BakeWords {
  std::string scene, output;
  uint32_t directions = 642;
  uint64_t memory_mib = 0;
  BakeOptions options;
};

/// Shows each new stage at once, and what happens inside it at a pace that a person or a log file can take.
class ProgressPrinter {
 public:
  void operator()(const BakeProgress& progress) {
    const bool new_stage = progress.stage != stage_;
    if (!new_stage && watch_.Seconds() < next_) return;
    stage_ = progress.stage;
    next_ = watch_.Seconds() + (isatty(STDERR_FILENO) == 1 ? 0.1 : 10.0);
    Log(LogLevel::kProgress, Describe(progress));
  }

 private:
  static std::string Describe(const BakeProgress& progress) {
    if (progress.tasks == 0) return progress.stage;
    char text[160];
    const double percent = 100.0 * static_cast<double>(progress.done) / static_cast<double>(progress.tasks);
    if (progress.slices_per_second <= 0) {
      std::snprintf(text, sizeof text, "%s: %3.0f %%", progress.stage.c_str(), percent);
    } else {
      std::snprintf(text, sizeof text, "%s: %3.0f %%, %.3g million slices/s, %.0f s left",
                    progress.stage.c_str(), percent, 1e-6 * progress.slices_per_second,
                    progress.seconds_left);
    }
    return text;
  }

  Stopwatch watch_;
  std::string stage_;
  double next_ = 0;
};

/// 12, 42, 162, ...: what --directions may be.
std::string GridSizes() {
  std::string sizes;
  for (int level = 0, size = 12; level <= DirectionGrid::kMaxLevel; ++level, size = 4 * size - 6) {
    sizes += (level > 0 ? ", " : "") + std::to_string(size);
  }
  return sizes;
}

Status RunBake(const BakeWords& words, const CommonWords& common) {
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output, {".glint"}));
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output + ".json", {".json"}));
  BakeOptions options = words.options;
  options.settings.grid_level = DirectionGrid::LevelOf(words.directions);
  if (options.settings.grid_level < 0) {
    return UsageError("--directions " + std::to_string(words.directions) + ": choose one of " + GridSizes());
  }
  options.threads = common.threads;
  options.memory_bytes = words.memory_mib << 20;

  ProgressPrinter printer;
  Result<BakeReport> baked = Bake(words.scene, words.output, options,
                                  [&printer](const BakeProgress& progress) { printer(progress); });
  if (baked.status().kind() == ErrorKind::kInterrupted)
    return Interrupted(baked.status().message() + "; run the same command again to go on");
  GLINT_ASSIGN_OR_RETURN(const BakeReport report, std::move(baked));
  for (const std::string& note : report.notes) Log(LogLevel::kNote, words.scene + ": " + note);
  char summary[160];
  std::snprintf(summary, sizeof summary, "%zu layers of %llu vertices x %llu directions, %.1f MB, in %.1f s",
                report.layers.size(), static_cast<unsigned long long>(report.vertices),
                static_cast<unsigned long long>(report.directions),
                1e-6 * static_cast<double>(report.archive_bytes), report.seconds);
  Log(LogLevel::kNote, "wrote " + words.output + " and " + words.output + ".json (" + summary + ")");
  if (common.json) PrintJson(nlohmann::ordered_json::parse(report.json));
  return {};
}

void AddAccuracyWords(CLI::App& app, BakeWords& words) {
  BakeOptions& options = words.options;
  BakeSettings& settings = options.settings;
  const auto add = [&app](const char* word, auto& value, const std::string& help) {
    return app.add_option(word, value, help)->capture_default_str()->group("Accuracy and time");
  };
  add("--directions", words.directions, "View directions: one of " + GridSizes())->type_name("N");
  add("--layers", options.max_layers, "Layers 0 to K: at most K indirect reflections")
      ->check(CLI::Range(0, kMaxIndirectLayers))
      ->type_name("K");
  add("--tolerance", options.layer_tolerance,
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
      ->type_name("X");
  add("--max-rays", settings.max_rays, "shared: at most this many rays per vertex")
      ->check(CLI::Range(settings.min_rays, 1 << 20))
      ->type_name("N");
  add("--paper-rays", settings.paper_rays, "paper: rays per slice and layer")
      ->check(CLI::Range(1, 1 << 20))
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
      ->type_name("N");
  add("--lobe-tolerance", settings.lobe_tolerance,
      "shared: no further lobe of a slice for less than this error, relative to its light")
      ->check(NumberRange(0, 1))
      ->type_name("X");
  add("--drop", settings.drop, "Leave out slices that change the light by less than this")
      ->check(NumberRange(0, 1))
      ->type_name("X");
  add("--seed", settings.seed, "Seed of the random numbers")->type_name("N");
}

void AddMachineWords(CLI::App& app, BakeWords& words) {
  BakeOptions& options = words.options;
  const std::string group = "Machine";
  app.add_option(
         "--work-dir", options.work_dir,
         "Folder for finished tasks, in a sub-folder of the bake's own (default: OUT.work beside the output)")
      ->type_name("FOLDER")
      ->group(group);
  app.add_flag("--keep-work", options.keep_work, "Keep that sub-folder after the archive is written")
      ->group(group);
  app.add_option("--memory", words.memory_mib,
                 "MiB for hits kept between layers; 0: a quarter of the machine's")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1} << 32))
      ->type_name("MIB")
      ->group(group);
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

}  // namespace

Command AddBakeCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("bake", "Bake a scene's light transport into an archive");
  const auto words = std::make_shared<BakeWords>();
  app.add_option("scene", words->scene, "Scene: glTF 2.0, .glb or .gltf")->required()->type_name("SCENE");
  app.add_option("-o,--output", words->output, "Archive to write; the report goes to OUT.glint.json")
      ->required()
      ->type_name("OUT.glint");
  AddAccuracyWords(app, *words);
  AddMachineWords(app, *words);
  AddCommonWords(app, common);
  app.footer(
      "Interrupted (Ctrl-C) or killed, the same command goes on where it was: finished tasks are in the work "
      "folder.\n"
      "\n"
      "Examples:\n"
      "  glint bake teapot.glb -o teapot.glint\n"
      "  glint bake teapot.glb -o teapot.glint --layers 2 --directions 2562 --threads 4\n"
      "  glint bake teapot.glb -o paper.glint --gather paper");
  return [words, &common] { return RunBake(*words, common); };
}

}  // namespace glint
