#include <memory>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/steady_clock.h"
#include "common/domain/bake_domain.h"
#include "common/render/reference.h"
#include "common/scene/load.h"
#include "common/scene/ray_scene.h"
#include "tools/commands.h"

namespace glint {
namespace {

struct ReferenceWords {
  std::string scene, output;
  ViewWords view;
  ToneMap tone;
  ReferenceOptions options;
  std::optional<int> only_bounce;
  bool full_float = false;
};

nlohmann::ordered_json Describe(const ReferenceWords& words, const View& view,
                                const ReferenceOptions& options, const ReferenceResult& result,
                                double seconds) {
  return {{"scene", words.scene},
          {"environment", words.view.environment},
          {"view", ToJson(view)},
          {"picture", words.output},
          {"brdf", options.lobes ? "lobes" : "true"},
          {"first_bounce", options.first_bounce},
          {"bounces", options.bounces},
          {"samples", options.samples},
          {"seed", options.seed},
          {"noise_rel_mse", result.noise_rel_mse},
          {"noise_block4_rel_mse", result.noise_block4_rel_mse},
          {"seconds", seconds}};
}

Status RunReference(const ReferenceWords& words, const CommonWords& common) {
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output, {".exr", ".png", ".hdr"}));
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output + ".json", {".json"}));
  ReferenceOptions options = words.options;
  options.threads = common.threads;
  if (words.only_bounce) options.first_bounce = options.bounces = *words.only_bounce;

  GLINT_ASSIGN_OR_RETURN(const Scene scene, LoadScene(words.scene));
  for (const std::string& note : scene.notes) Log(LogLevel::kNote, words.scene + ": " + note);
  GLINT_ASSIGN_OR_RETURN(const View view, MakeView(words.view, scene.cameras, scene.positions));
  GLINT_ASSIGN_OR_RETURN(const Environment environment, OpenEnvironment(words.view));
  const RayScene rays(scene, common.threads);
  std::optional<BakeDomain> domain;
  if (options.lobes) domain = BuildBakeDomain(scene, BrdfFitOptions{}, common.threads);

  const Stopwatch watch;
  GLINT_ASSIGN_OR_RETURN(
      const ReferenceResult result,
      RenderReference(scene, rays, domain ? &*domain : nullptr, environment, view, options));
  const nlohmann::ordered_json description = Describe(words, view, options, result, watch.Seconds());

  GLINT_RETURN_IF_ERROR(WritePicture(result.picture, words.output, words.tone, words.full_float));
  const std::string text =
      description.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + '\n';
  GLINT_RETURN_IF_ERROR(PublishFile(words.output + ".json", std::as_bytes(std::span(text))));
  Log(LogLevel::kNote, "wrote " + words.output + " and " + words.output + ".json (noise: relMSE " +
                           std::to_string(result.noise_rel_mse) + ")");
  if (common.json) PrintJson(description);
  return {};
}

}  // namespace

Command AddReferenceCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app =
      *glint.add_subcommand("reference", "Path-trace a scene: the truth that archives are compared with");
  const auto words = std::make_shared<ReferenceWords>();
  ReferenceOptions& options = words->options;
  app.add_option("scene", words->scene, "Scene: glTF 2.0, .glb or .gltf")->required()->type_name("SCENE");
  app.add_option("-o,--output", words->output, "Picture to write; its noise and settings go to PICTURE.json")
      ->required()
      ->type_name("PICTURE");
  AddViewWords(app, words->view);
  AddToneWords(app, words->tone);
  CLI::Option* bounces =
      app.add_option("--bounces", options.bounces, "Indirect bounces: 0 is camera, surface, environment");
  bounces->check(CLI::Range(0, 1024))->type_name("K")->capture_default_str();
  app.add_option("--only-bounce", words->only_bounce,
                 "Only paths with exactly K indirect bounces, as render's --layer")
      ->check(CLI::Range(0, 1024))
      ->type_name("K")
      ->excludes(bounces);
  app.add_option("--spp", options.samples, "Paths per pixel, even: two halves tell the noise")
      ->check(CLI::Range(2, 1 << 20))
      ->check([](const std::string& text) {
        return (text.back() - '0') % 2 == 0 ? std::string() : "--spp must be even, not " + text;
      })
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--seed", options.seed, "Seed of the random numbers")->type_name("N")->capture_default_str();
  AddChoice<bool>(app, "--brdf", options.lobes, {{"true", false}, {"lobes", true}},
                  "BRDF: true (default), or the lobes that the bake fits to it");
  app.add_flag("--float", words->full_float, "Write EXR with 32 bits a channel (default: 16)");
  AddCommonWords(app, common);
  app.footer(
      "Examples:\n"
      "  glint reference teapot.glb --env sky.exr --bounces 2 --spp 256 -o truth.exr\n"
      "  glint reference teapot.glb --brdf lobes --only-bounce 1 --camera main -o layer1.exr");
  return [words, &common] { return RunReference(*words, common); };
}

}  // namespace glint
