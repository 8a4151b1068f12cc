#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/base/status.h"
#include "common/render/environment.h"
#include "common/render/image.h"
#include "common/render/view.h"

namespace glint {

/// Words that every sub-command has.
struct CommonWords {
  int threads = 0;     ///< 0: one per core that the process may run on
  bool quiet = false;  ///< errors only
  bool json = false;   ///< one JSON object on standard output
};

/// Where to look from and how large: the same words wherever a picture is made.
struct ViewWords {
  std::string camera;                             ///< name in the file; empty: none asked for
  std::optional<glm::vec3> eye, look_at, up;      ///< world
  std::optional<float> fov_deg;                   ///< vertical
  int width = 512, height = 512;                  ///< pixels
  std::string environment = "procedural:studio";  ///< path or procedural:NAME
  float environment_rotation_deg = 0;             ///< about +Y
  Background background = Background::kBlack;
};

/// The body of a sub-command, called after its words were read.
using Command = std::function<Status()>;

void AddCommonWords(CLI::App& app, CommonWords& words);
void AddViewWords(CLI::App& app, ViewWords& words);
/// `--exposure` and `--tone`: how PNG pictures (and what compares them) see radiance.
void AddToneWords(CLI::App& app, ToneMap& tone);

/// A word whose value is one of a few names; help shows them as "a|b".
template <class T>
CLI::Option* AddChoice(CLI::App& app, const std::string& word, T& value,
                       const std::vector<std::pair<std::string, T>>& choices, const std::string& help) {
  std::string names;
  for (const auto& choice : choices) names += (names.empty() ? "" : "|") + choice.first;
  const auto choose = [&value, word, choices, names](const std::string& text) {
    for (const auto& [name, chosen] : choices) {
      if (name != text) continue;
      value = chosen;
      return;
    }
    throw CLI::ValidationError(word, "'" + text + "' is not one of " + names);
  };
  return app.add_option_function<std::string>(word, choose, help)->type_name(names);
}

/// The view that the words ask for. Without a camera: the first of `cameras`; without any: one that frames
/// `positions`. kUsage naming the word and the remedy.
Result<View> MakeView(const ViewWords& words, std::span<const Camera> cameras,
                      std::span<const glm::vec3> positions);
/// A camera from above and to the side whose picture of width / height = `aspect` holds all positions.
Camera FramingCamera(std::span<const glm::vec3> positions, float aspect);
/// Opens the environment of the words; notes what was repaired in it.
Result<Environment> OpenEnvironment(const ViewWords& words);

/// A check of a word: one finite number from `low` to `high`.
CLI::Validator NumberRange(double low, double high);

/// Fails before hours of work do: `path` must end in one of `extensions` (".exr", in any case; kUsage), and a
/// file can be put there (kUsage, kIo: CheckPublishable).
Status CheckOutput(const std::filesystem::path& path, const std::vector<std::string>& extensions);

/// Writes one JSON object to standard output.
void PrintJson(const nlohmann::ordered_json& object);
nlohmann::ordered_json ToJson(const View& view);
nlohmann::ordered_json ToJson(const glm::vec3& v);

}  // namespace glint
