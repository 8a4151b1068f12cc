#include <iostream>
#include <memory>

#include "common/base/log.h"
#include "common/render/environment.h"
#include "common/scene/generate.h"
#include "common/scene/load.h"
#include "tools/commands.h"

namespace glint {
namespace {

struct SceneWords {
  std::string name, output;
  GenerateOptions options;
  bool list = false;
};

struct EnvironmentWords {
  std::string name, output;
  int width = 512;
  bool list = false;
};

/// @param kind  what they are: the key of the list in JSON
void PrintList(const char* kind, const std::vector<GeneratedScene>& entries, bool json) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  for (const auto& [name, description] : entries) {
    array.push_back({{"name", name}, {"description", description}});
    if (!json)
      std::cout << name << std::string(name.size() < 10 ? 10 - name.size() : 1, ' ') << description << '\n';
  }
  if (json) PrintJson(nlohmann::ordered_json::object({{kind, array}}));
}

Status RequireNameAndOutput(const std::string& name, const std::string& output, const std::string& command) {
  if (name.empty()) return UsageError("no name given; 'glint " + command + " --list' shows them");
  if (output.empty()) return UsageError("-o is missing: say which file to write");
  return {};
}

Status RunScene(const SceneWords& words, const CommonWords& common) {
  if (words.list) {
    PrintList("scenes", GeneratedScenes(), common.json);
    return {};
  }
  GLINT_RETURN_IF_ERROR(RequireNameAndOutput(words.name, words.output, "scene"));
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output, {".glb"}));
  GLINT_ASSIGN_OR_RETURN(const Scene scene, GenerateScene(words.name, words.options));
  GLINT_RETURN_IF_ERROR(SaveScene(scene, words.output));
  Log(LogLevel::kNote, "wrote " + words.output + " (" + std::to_string(scene.positions.size()) +
                           " vertices, " + std::to_string(scene.triangles.size()) + " triangles)");
  if (common.json) {
    PrintJson({{"scene", words.output},
               {"vertices", scene.positions.size()},
               {"triangles", scene.triangles.size()}});
  }
  return {};
}

const std::vector<GeneratedScene>& ProceduralEnvironments() {
  static const std::vector<GeneratedScene> entries{{"studio", "soft boxes in a dark room"},
                                                   {"sunset", "small sun above a bright horizon"},
                                                   {"uniform", "radiance 1 from everywhere"}};
  return entries;
}

Picture ToPicture(const Environment& environment) {
  Picture picture(environment.width(), environment.height());
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = glm::vec4(environment.texels()[i], 1);
  return picture;
}

Status RunEnvironment(const EnvironmentWords& words, const CommonWords& common) {
  if (words.list) {
    PrintList("environments", ProceduralEnvironments(), common.json);
    return {};
  }
  GLINT_RETURN_IF_ERROR(RequireNameAndOutput(words.name, words.output, "environment"));
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output, {".exr", ".hdr"}));
  GLINT_ASSIGN_OR_RETURN(const Environment environment, Environment::Procedural(words.name, words.width));
  GLINT_RETURN_IF_ERROR(WritePicture(ToPicture(environment), words.output, {}, /*full_float=*/true));
  Log(LogLevel::kNote, "wrote " + words.output);
  if (common.json) {
    PrintJson(
        {{"environment", words.output}, {"width", environment.width()}, {"height", environment.height()}});
  }
  return {};
}

}  // namespace

Command AddSceneCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("scene", "Write one of Glint's own scenes as a glTF file");
  const auto words = std::make_shared<SceneWords>();
  app.add_option("name", words->name, "Scene's name; --list shows them")->type_name("NAME");
  app.add_option("-o,--output", words->output, "File to write: .glb")->type_name("SCENE.glb");
  app.add_option("--vertices", words->options.vertices, "Vertices to aim at")
      ->type_name("N")
      ->capture_default_str();
  app.add_option(
         "--exponent", words->options.exponent,
         "Make all specular materials Phong with this exponent, as in the papers' tables (0: leave them)")
      ->check(NumberRange(0, 1e6))
      ->type_name("E");
  app.add_flag("--list", words->list, "List the scenes");
  AddCommonWords(app, common);
  app.footer(
      "Examples:\n"
      "  glint scene --list\n"
      "  glint scene teapot -o teapot.glb\n"
      "  glint scene goblets --vertices 10000 --exponent 128 -o goblets.glb");
  return [words, &common] { return RunScene(*words, common); };
}

Command AddEnvironmentCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app =
      *glint.add_subcommand("environment", "Write one of Glint's own skies as an equirectangular picture");
  const auto words = std::make_shared<EnvironmentWords>();
  app.add_option("name", words->name, "Sky's name; --list shows them")->type_name("NAME");
  app.add_option("-o,--output", words->output, "File to write: .exr or .hdr")->type_name("SKY");
  app.add_option("--width", words->width, "Width in pixels; the height is half of it")
      ->check(CLI::Range(16, 16384))
      ->type_name("N")
      ->capture_default_str();
  app.add_flag("--list", words->list, "List the skies");
  AddCommonWords(app, common);
  app.footer(
      "Examples:\n"
      "  glint environment --list\n"
      "  glint environment sunset --width 1024 -o sunset.exr");
  return [words, &common] { return RunEnvironment(*words, common); };
}

}  // namespace glint
