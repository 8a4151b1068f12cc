#include "tools/options.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <iostream>
#include <sstream>

#include "common/base/files.h"
#include "common/base/log.h"

namespace glint {
namespace {

constexpr float kDefaultFovDeg = 40;
constexpr int kMaxSide = 32768;
constexpr float kFarthest = 1e15f;  ///< larger co-ordinates overflow when rays are intersected

/// Numbers from -kFarthest to kFarthest separated by commas, as many as `values` holds; false for anything
/// else.
bool ParseNumbers(const std::string& text, std::span<float> values) {
  const char* at = text.data();
  const char* const end = text.data() + text.size();
  for (size_t i = 0; i < values.size(); ++i) {
    if (i > 0 && (at == end || *at++ != ',')) return false;
    if (at != end && *at == '+') ++at;
    const auto [next, error] = std::from_chars(at, end, values[i]);
    if (error != std::errc() || !(std::abs(values[i]) <= kFarthest)) return false;
    at = next;
  }
  return at == end;
}

glm::vec3 ParseVector(const std::string& word, const std::string& text) {
  std::array<float, 3> v{};
  if (!ParseNumbers(text, v)) {
    throw CLI::ValidationError(word, "'" + text + "' is not three numbers X,Y,Z from -1e15 to 1e15");
  }
  return {v[0], v[1], v[2]};
}

void ParseSize(const std::string& text, ViewWords& words) {
  int width = 0, height = 0;
  const char* const end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, width);
  const bool has_cross = first.ptr != end && (*first.ptr == 'x' || *first.ptr == 'X');
  const auto second = has_cross ? std::from_chars(first.ptr + 1, end, height) : first;
  if (!has_cross || second.ptr != end || second.ec != std::errc() || std::min(width, height) < 1 ||
      std::max(width, height) > kMaxSide) {
    throw CLI::ValidationError("--size", "'" + text + "' is not WIDTHxHEIGHT with sides from 1 to " +
                                             std::to_string(kMaxSide) + ", for instance 1024x768");
  }
  words.width = width;
  words.height = height;
}

void AddVectorWord(CLI::App& app, const std::string& word, std::optional<glm::vec3>& value,
                   const char* help) {
  app.add_option_function<std::string>(
         word, [&value, word](const std::string& text) { value = ParseVector(word, text); }, help)
      ->type_name("X,Y,Z")
      ->group("View");
}

std::string CameraNames(std::span<const Camera> cameras) {
  std::string names;
  for (const Camera& camera : cameras) names += (names.empty() ? "'" : ", '") + camera.name + "'";
  return names.empty() ? "it has none; use --eye and --look-at" : "it has " + names;
}

/// Centre and half diagonal of the bounding box.
struct Bounds {
  glm::vec3 centre{0};
  float radius = 1;
};
Bounds BoundsOf(std::span<const glm::vec3> positions) {
  if (positions.empty()) return {};
  glm::vec3 low = positions[0], high = positions[0];
  for (const glm::vec3& p : positions) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  const float radius = 0.5f * glm::length(high - low);
  return {0.5f * (low + high), radius > 0 ? radius : 1};
}

Result<Camera> NamedCamera(const std::string& name, std::span<const Camera> cameras) {
  const auto found =
      std::find_if(cameras.begin(), cameras.end(), [&](const Camera& c) { return c.name == name; });
  if (found != cameras.end()) return *found;
  return UsageError("--camera: the file has no camera called '" + name + "': " + CameraNames(cameras));
}

/// The camera before --eye, --look-at, --up and --fov change it.
Result<Camera> StartCamera(const ViewWords& words, std::span<const Camera> cameras,
                           std::span<const glm::vec3> positions) {
  if (!words.camera.empty()) return NamedCamera(words.camera, cameras);
  if (!words.eye && !cameras.empty()) return cameras[0];
  return FramingCamera(positions, static_cast<float>(words.width) / static_cast<float>(words.height));
}

}  // namespace

void AddCommonWords(CLI::App& app, CommonWords& words) {
  app.add_option("--threads", words.threads, "Threads to use; 0: one per core")
      ->check(CLI::Range(0, 4096))
      ->type_name("N");
  app.add_flag("--quiet", words.quiet, "Write nothing but errors to standard error");
  app.add_flag("--json", words.json, "Write the result as one JSON object to standard output");
}

void AddViewWords(CLI::App& app, ViewWords& words) {
  CLI::Option* camera =
      app.add_option("--camera", words.camera, "Camera of the file, by name (default: its first)");
  camera->type_name("NAME")->group("View");
  AddVectorWord(app, "--eye", words.eye, "Where the camera is, in the scene's units");
  AddVectorWord(app, "--look-at", words.look_at,
                "Point in the middle of the picture (default: the scene's middle)");
  AddVectorWord(app, "--up", words.up, "Direction that is up in the picture (default: 0,1,0)");
  for (const char* word : {"--eye", "--look-at", "--up"}) camera->excludes(app.get_option(word));
  app.get_option("--look-at")->needs(app.get_option("--eye"));
  app.get_option("--up")->needs(app.get_option("--eye"));
  app.add_option("--fov", words.fov_deg,
                 "Vertical field of view, degrees (default: the camera's; 40 with --eye)")
      ->check(NumberRange(0.1, 179))
      ->type_name("DEG")
      ->group("View");
  app.add_option_function<std::string>(
         "--size", [&words](const std::string& text) { ParseSize(text, words); },
         "Size of the picture in pixels (default: " + std::to_string(words.width) + "x" +
             std::to_string(words.height) + ")")
      ->type_name("WxH")
      ->group("View");
  app.add_option(
         "--env", words.environment,
         "Environment: an equirectangular .exr or .hdr file, or procedural:NAME (glint environment --list)")
      ->type_name("SKY")
      ->capture_default_str()
      ->group("View");
  app.add_option("--env-rotate", words.environment_rotation_deg, "Turn the environment about +Y, degrees")
      ->check(NumberRange(-1e6, 1e6))
      ->type_name("DEG")
      ->group("View");
  AddChoice<Background>(app, "--background", words.background,
                        {{"none", Background::kBlack}, {"environment", Background::kEnvironment}},
                        "What shows where nothing is hit: none (black, alpha 0), environment")
      ->group("View");
}

void AddToneWords(CLI::App& app, ToneMap& tone) {
  app.add_option("--exposure", tone.exposure,
                 "Factor on radiance before tone mapping (PNG only; EXR stays linear)")
      ->check(NumberRange(1e-6, 1e6))
      ->type_name("X")
      ->group("Tone mapping");
  AddChoice<bool>(app, "--tone", tone.reinhard, {{"reinhard", true}, {"clamp", false}},
                  "Tone curve: reinhard (default) or clamp")
      ->group("Tone mapping");
}

Camera FramingCamera(std::span<const glm::vec3> positions, float aspect) {
  const Bounds bounds = BoundsOf(positions);
  Camera camera;
  camera.name = "default";
  camera.vertical_fov = glm::radians(kDefaultFovDeg);
  camera.forward = -glm::normalize(glm::vec3(0.5f, 0.45f, 1.0f));
  camera.up = {0, 1, 0};
  // The bounding sphere touches the picture's nearer pair of edges.
  const float half_tangent = std::tan(0.5f * camera.vertical_fov) * std::min(aspect, 1.0f);
  camera.eye = bounds.centre - camera.forward * (bounds.radius / std::sin(std::atan(half_tangent)));
  return camera;
}

Result<View> MakeView(const ViewWords& words, std::span<const Camera> cameras,
                      std::span<const glm::vec3> positions) {
  View view;
  GLINT_ASSIGN_OR_RETURN(view.camera, StartCamera(words, cameras, positions));
  if (words.eye) {
    const glm::vec3 look_at = words.look_at.value_or(BoundsOf(positions).centre);
    const std::optional<glm::vec3> forward = UnitDirection(look_at - *words.eye);
    if (!forward) {
      return UsageError("--eye and --look-at are one point, or too far apart; move one of them");
    }
    view.camera.name = "command line";
    view.camera.eye = *words.eye;
    view.camera.forward = *forward;
    const std::optional<glm::vec3> up = UnitDirection(words.up.value_or(glm::vec3(0, 1, 0)));
    if (!up || !(glm::length(glm::cross(*forward, *up)) > 1e-4f)) {
      return UsageError("--up is zero or along the view; give another direction, for instance --up 0,0,1");
    }
    view.camera.up = *up;
  }
  if (words.fov_deg) view.camera.vertical_fov = glm::radians(*words.fov_deg);
  view.width = words.width;
  view.height = words.height;
  view.environment_rotation_deg = words.environment_rotation_deg;
  view.background = words.background;
  GLINT_RETURN_IF_ERROR(CheckView(view));
  return view;
}

Result<Environment> OpenEnvironment(const ViewWords& words) {
  GLINT_ASSIGN_OR_RETURN(Environment environment, Environment::Open(words.environment));
  if (environment.clamped() > 0) {
    Log(LogLevel::kWarning, words.environment + ": " + std::to_string(environment.clamped()) +
                                " negative values were taken as 0");
  }
  return environment;
}

CLI::Validator NumberRange(double low, double high) {
  std::ostringstream range;
  range << '[' << low << " - " << high << ']';
  const auto check = [low, high, range = range.str()](const std::string& text) {
    double value = 0;
    // Written so that what is not a number fails.
    const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
    return good ? std::string() : "'" + text + "' is not a number in " + range;
  };
  return {check, "FLOAT in " + range.str(), ""};
}

Status CheckOutput(const std::filesystem::path& path, const std::vector<std::string>& extensions) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (std::find(extensions.begin(), extensions.end(), extension) == extensions.end()) {
    std::string known;
    for (const std::string& e : extensions) known += (known.empty() ? "" : ", ") + e;
    return UsageError(path.string() + ": unknown kind of output '" + extension +
                      "'; the name must end in one of " + known);
  }
  return CheckPublishable(path);
}

void PrintJson(const nlohmann::ordered_json& object) {
  // A name in another encoding than UTF-8 must not make the whole answer fail.
  std::cout << object.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
}

nlohmann::ordered_json ToJson(const glm::vec3& v) { return {v.x, v.y, v.z}; }

nlohmann::ordered_json ToJson(const View& view) {
  return {{"camera",
           {{"name", view.camera.name},
            {"eye", ToJson(view.camera.eye)},
            {"forward", ToJson(view.camera.forward)},
            {"up", ToJson(view.camera.up)},
            {"vertical_fov_deg", glm::degrees(view.camera.vertical_fov)}}},
          {"width", view.width},
          {"height", view.height},
          {"environment_rotation_deg", view.environment_rotation_deg},
          {"background", view.background == Background::kBlack ? "none" : "environment"}};
}

}  // namespace glint
