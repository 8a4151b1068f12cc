#include <algorithm>
#include <memory>

#include "common/archive/archive.h"
#include "common/base/log.h"
#include "common/base/steady_clock.h"
#include "common/render/archive_renderer.h"
#include "tools/commands.h"
#include "tools/report.h"

namespace glint {
namespace {

const std::vector<std::string> kPictures{".exr", ".png", ".hdr"};

struct RenderWords {
  std::string archive, output;
  ViewWords view;
  ToneMap tone;
  std::optional<int> last_layer, only_layer;
  bool per_layer = false;
  bool full_float = false;
  int samples = 4;
};

/// One picture to make: the sum of these layers.
struct Job {
  std::filesystem::path path;
  int first_layer = 0, last_layer = 0;
};

/// picture.exr -> picture.layer2.exr
std::filesystem::path LayerPath(const std::filesystem::path& path, int layer) {
  std::filesystem::path result = path;
  return result.replace_extension("layer" + std::to_string(layer) + path.extension().string());
}

/// Whether the bake ended because the layers that are not there would carry next to nothing.
bool IsComplete(const Archive& archive) {
  const nlohmann::ordered_json report = ParseReport(archive.report_json());
  const auto complete = report.find("complete");
  return complete != report.end() && complete->is_boolean() && complete->get<bool>();
}

Result<std::vector<Job>> PlanJobs(const RenderWords& words, const Archive& archive) {
  const int layers = static_cast<int>(archive.layers().size());
  const int wanted = words.only_layer ? *words.only_layer : words.last_layer.value_or(0);
  if (wanted >= layers) {
    const std::string there = words.archive + ": layer " + std::to_string(wanted) +
                              " is not there; it has layers 0 to " + std::to_string(layers - 1);
    if (!IsComplete(archive)) {
      return UsageError(there + "; ask for one of these, or bake again with more --layers");
    }
    Log(LogLevel::kNote,
        there + ", and those above carry less light than the bake's tolerance: taken as none");
  }
  const int last = std::min(words.last_layer.value_or(layers - 1), layers - 1);
  const Job sum{words.output, words.only_layer.value_or(0), words.only_layer.value_or(last)};
  std::vector<Job> jobs{sum};
  if (words.per_layer) {
    for (int layer = sum.first_layer; layer <= sum.last_layer; ++layer) {
      jobs.push_back({LayerPath(words.output, layer), layer, layer});
    }
  }
  for (const Job& job : jobs) GLINT_RETURN_IF_ERROR(CheckOutput(job.path, kPictures));
  return jobs;
}

Status RunRender(const RenderWords& words, const CommonWords& common) {
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output, kPictures));
  const Stopwatch open_watch;
  GLINT_ASSIGN_OR_RETURN(const Archive archive, Archive::Open(words.archive));
  GLINT_ASSIGN_OR_RETURN(const View view,
                         MakeView(words.view, archive.cameras(), archive.domain().positions));
  GLINT_ASSIGN_OR_RETURN(const std::vector<Job> jobs, PlanJobs(words, archive));
  const double open_seconds = open_watch.Seconds();

  const Stopwatch environment_watch;
  GLINT_ASSIGN_OR_RETURN(const Environment environment, OpenEnvironment(words.view));
  const PrefilteredEnvironment prefiltered(environment, common.threads);
  const double environment_seconds = environment_watch.Seconds();

  nlohmann::ordered_json pictures = nlohmann::ordered_json::array();
  for (const Job& job : jobs) {
    ArchiveRenderer renderer(archive, prefiltered,
                             {.first_layer = job.first_layer,
                              .last_layer = job.last_layer,
                              .samples = words.samples,
                              .threads = common.threads});
    const Stopwatch render_watch;
    GLINT_ASSIGN_OR_RETURN(const Picture picture, renderer.Render(view));
    const double seconds = render_watch.Seconds();
    GLINT_RETURN_IF_ERROR(WritePicture(picture, job.path, words.tone, words.full_float));
    Log(LogLevel::kNote, "wrote " + job.path.string() + " (layers " + std::to_string(job.first_layer) +
                             " to " + std::to_string(job.last_layer) + ")");
    pictures.push_back({{"path", job.path.string()},
                        {"first_layer", job.first_layer},
                        {"last_layer", job.last_layer},
                        {"render_seconds", seconds}});
  }
  if (common.json) {
    PrintJson({{"archive", words.archive},
               {"environment", words.view.environment},
               {"view", ToJson(view)},
               {"samples", words.samples},
               {"open_seconds", open_seconds},
               {"environment_seconds", environment_seconds},
               {"pictures", pictures}});
  }
  return {};
}

}  // namespace

Command AddRenderCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app =
      *glint.add_subcommand("render", "Relight an archive: a picture from any view under any environment");
  const auto words = std::make_shared<RenderWords>();
  app.add_option("archive", words->archive, "Archive that 'glint bake' wrote")
      ->required()
      ->type_name("ARCHIVE");
  app.add_option("-o,--output", words->output, "Picture to write: .exr (linear), .hdr, .png (tone-mapped)")
      ->required()
      ->type_name("PICTURE");
  AddViewWords(app, words->view);
  AddToneWords(app, words->tone);
  CLI::Option* layers = app.add_option("--layers", words->last_layer, "Layers 0 to K (default: all)");
  layers->check(CLI::Range(0, 1 << 20))->type_name("K");
  app.add_option("--layer", words->only_layer,
                 "Only layer K: 0 is direct light, 1 the first indirect reflection")
      ->check(CLI::Range(0, 1 << 20))
      ->type_name("K")
      ->excludes(layers);
  app.add_flag("--per-layer", words->per_layer, "Also one picture per layer: picture.layer0.exr, ...");
  app.add_option("--samples", words->samples, "Camera rays per pixel")
      ->check(CLI::Range(1, 4096))
      ->type_name("N")
      ->capture_default_str();
  app.add_flag("--float", words->full_float, "Write EXR with 32 bits a channel (default: 16)");
  AddCommonWords(app, common);
  app.footer(
      "Examples:\n"
      "  glint render teapot.glint -o teapot.png\n"
      "  glint render teapot.glint --env sky.exr --env-rotate 90 --camera main --size 1024x768 -o "
      "teapot.exr\n"
      "  glint render teapot.glint --eye 2,1.5,3 --look-at 0,0.5,0 --fov 35 --background environment -o "
      "view.png\n"
      "  glint render teapot.glint --layers 1 --per-layer -o direct-and-first.exr");
  return [words, &common] { return RunRender(*words, common); };
}

}  // namespace glint
