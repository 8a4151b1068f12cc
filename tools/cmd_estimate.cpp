#include <iostream>
#include <memory>

#include "common/archive/archive.h"
#include "common/domain/bare_scene.h"
#include "common/domain/direction_grid.h"
#include "common/scene/ray_scene.h"
#include "coordinator/error_estimate.h"
#include "tools/commands.h"
#include "tools/report.h"

namespace glint {
namespace {

struct EstimateWords {
  std::string archive;
  EstimateOptions options;
};

/// The settings that the estimate shares with the bake, from the archive's report as far as it has them.
void TakeSettings(const nlohmann::ordered_json& report, EstimateOptions* options) {
  if (!report.is_object() || !report.contains("settings") || !report["settings"].is_object()) return;
  const auto take = [&](const char* name, auto* value) {
    const auto found = report["settings"].find(name);
    if (found != report["settings"].end() && found->is_number()) found->get_to(*value);
  };
  take("drop", &options->read_out.drop);
  take("lobe_tolerance", &options->read_out.lobe_tolerance);
  take("seed", &options->seed);
}

Status RunEstimate(const EstimateWords& words, const CommonWords& common) {
  GLINT_ASSIGN_OR_RETURN(const Archive archive, Archive::Open(words.archive));
  EstimateOptions options = words.options;
  options.threads = common.threads;
  TakeSettings(ParseReport(archive.report_json()), &options);
  if (!archive.layers().empty())
    options.read_out.slice_lobes = static_cast<int>(archive.layers().back().lobes());
  const RayScene rays(BareScene(archive.domain()));
  const DirectionGrid grid = archive.MakeGrid();
  GLINT_ASSIGN_OR_RETURN(const ErrorEstimate estimate,
                         EstimateError(archive.domain(), rays, grid, archive.layers(), options));
  const auto json = nlohmann::ordered_json::parse(ToJson(estimate));
  if (common.json) {
    PrintJson(json);
  } else {
    std::cout << ErrorTable(json);
  }
  return {};
}

}  // namespace

Command AddEstimateCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("estimate", "Test an archive's slices with many rays: its error");
  const auto words = std::make_shared<EstimateWords>();
  words->options.slices = 4096;
  app.add_option("archive", words->archive, "Archive that 'glint bake' wrote")
      ->required()
      ->type_name("ARCHIVE");
  app.add_option("--slices", words->options.slices, "Slices to test, at random positions and directions")
      ->check(CLI::Range(1, kMaxEstimateSlices))
      ->capture_default_str()
      ->type_name("N");
  AddCommonWords(app, common);
  app.footer(
      "What 'glint bake' estimates by a few slices and writes into its report, by as many as you like.\n"
      "\n"
      "Examples:\n"
      "  glint estimate teapot.glint\n"
      "  glint estimate teapot.glint --slices 65536 --json");
  return [words, &common] { return RunEstimate(*words, common); };
}

}  // namespace glint
