#include <filesystem>
#include <iostream>
#include <memory>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/scene/load.h"
#include "tools/chart/chart.h"
#include "tools/chart/method.h"
#include "tools/chart/tables.h"
#include "tools/commands.h"

namespace glint {
namespace {

struct ChartWords {
  std::string scene, output;
  ViewWords view;
  ToneMap tone;
  ReferenceOptions reference;
  int samples = 64;  ///< with few, edges of shapes hide what bakes differ in
  chart::Sweep sweep;
};

Status CheckFolder(const std::filesystem::path& folder) {
  std::error_code error;
  if (!std::filesystem::exists(folder, error) || std::filesystem::is_directory(folder, error)) return {};
  return UsageError(folder.string() +
                    ": is not a folder; give the name of a folder, which is made if needed");
}

Status RunChart(const ChartWords& words, const CommonWords& common) {
  GLINT_RETURN_IF_ERROR(CheckFolder(words.output));
  chart::Settings base;
  base.bake.max_layers = words.reference.bounces;
  GLINT_ASSIGN_OR_RETURN(const std::vector<chart::Point> points,
                         chart::ExpandSweep(words.sweep, chart::MethodNames(), base));

  GLINT_ASSIGN_OR_RETURN(const Scene scene, LoadScene(words.scene));
  for (const std::string& note : scene.notes) Log(LogLevel::kNote, words.scene + ": " + note);
  GLINT_ASSIGN_OR_RETURN(const View view, MakeView(words.view, scene.cameras, scene.positions));
  GLINT_ASSIGN_OR_RETURN(const Environment environment, OpenEnvironment(words.view));
  const chart::Input input{.scene = scene,
                           .environment = environment,
                           .scene_name = std::filesystem::path(words.scene).filename().string(),
                           .environment_name = words.view.environment,
                           .view = view,
                           .reference = words.reference,
                           .samples = words.samples,
                           .tone = words.tone,
                           .threads = common.threads};
  GLINT_RETURN_IF_ERROR(CreateFolders(words.output));
  GLINT_ASSIGN_OR_RETURN(const chart::Measured measured, chart::Measure(input, points, words.output));
  const Status published = chart::Publish(input, measured, words.output);

  if (common.json) {
    PrintJson(chart::ChartJson(input, measured));
  } else {
    std::cout << chart::ChartText(measured);
  }
  if (!published.ok()) return published;
  Log(LogLevel::kNote, "wrote " + (std::filesystem::path(words.output) / "index.html").string() +
                           ", chart.csv, chart.json and the plots beside it");
  return {};
}

void AddSweepWords(CLI::App& app, chart::Sweep& sweep) {
  std::string methods;
  for (const chart::Method& method : chart::Methods()) {
    sweep.methods += (sweep.methods.empty() ? "" : ",") + method.name;
    methods += (methods.empty() ? "" : ", ") + method.name + " (" + method.help + ")";
  }
  app.add_option("--gather", sweep.methods, "Ways to gather: " + methods)
      ->type_name("LIST")
      ->capture_default_str()
      ->group("Sweep");
  for (const chart::Axis& axis : chart::Axes()) {
    std::string& values = sweep.values[axis.word] = axis.defaults;
    app.add_option("--" + axis.word, values, axis.help)
        ->type_name(axis.type + ",...")
        ->capture_default_str()
        ->group("Sweep");
  }
}

void AddReferenceWords(CLI::App& app, ChartWords& words) {
  ReferenceOptions& options = words.reference;
  app.add_option("--bounces,--layers", options.bounces,
                 "Indirect bounces of the reference, and layers of the bakes above 0")
      ->check(CLI::Range(0, 1024))
      ->type_name("K")
      ->capture_default_str()
      ->group("Measure");
  app.add_option("--spp", options.samples, "Paths per pixel of the reference, even")
      ->check(CLI::Range(2, 1 << 20))
      ->check([](const std::string& text) {
        return (text.back() - '0') % 2 == 0 ? std::string() : "--spp must be even, not " + text;
      })
      ->type_name("N")
      ->capture_default_str()
      ->group("Measure");
  app.add_option("--seed", options.seed, "Seed of the reference's random numbers")
      ->type_name("N")
      ->capture_default_str()
      ->group("Measure");
  AddChoice<bool>(app, "--brdf", options.lobes, {{"true", false}, {"lobes", true}},
                  "BRDF of the reference: true (default), or the lobes that a bake fits to it")
      ->group("Measure");
  app.add_option("--samples", words.samples, "Camera rays per pixel of the points' pictures")
      ->check(CLI::Range(1, 4096))
      ->type_name("N")
      ->capture_default_str()
      ->group("Measure");
}

}  // namespace

Command AddChartCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app =
      *glint.add_subcommand("chart", "Sweep settings: error over seconds and bytes, against the reference");
  const auto words = std::make_shared<ChartWords>();
  words->view.width = words->view.height = 256;
  words->reference.samples = 256;
  app.add_option("scene", words->scene, "Scene: glTF 2.0, .glb or .gltf")->required()->type_name("SCENE");
  app.add_option("-o,--output", words->output, "Folder for tables, plots, page and finished points")
      ->required()
      ->type_name("DIR");
  AddSweepWords(app, words->sweep);
  AddReferenceWords(app, *words);
  AddViewWords(app, words->view);
  AddToneWords(app, words->tone);
  AddCommonWords(app, common);
  app.footer(
      "Every combination is a point: baked, rendered and compared with one path-traced picture. Points are\n"
      "kept in DIR; the same command, or one with other values, computes only those that are missing.\n"
      "The plots are drawn by gnuplot (package gnuplot-nox); without it the rest is written, and the exit\n"
      "code is 6.\n"
      "\n"
      "Examples:\n"
      "  glint chart teapot.glb --env procedural:sunset -o chart\n"
      "  glint chart teapot.glb -o chart --gather shared --directions 162,642,2562 --rays-per-kappa 2,4,8 "
      "--lobes 1,3\n"
      "  glint chart teapot.glb -o chart --camera main --brdf lobes --bounces 1 --spp 1024");
  return [words, &common] { return RunChart(*words, common); };
}

}  // namespace glint
