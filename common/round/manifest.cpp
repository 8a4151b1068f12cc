#include "common/round/manifest.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/domain/direction_grid.h"
#include "common/queue/task_queue.h"
#include "common/round/json_field.h"
#include "common/round/settings_json.h"
#include "common/scene/scene.h"

namespace glint {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kVersion = 1;
constexpr size_t kMaxExecution = 1024;  ///< characters
constexpr int kMaxLayer = 255;

/// Reads fields one after the other; the first that is wrong stays as the status.
class FieldReader {
 public:
  explicit FieldReader(const Json& json) : json_(json) {}

  std::string Text(const char* name, size_t max_length) {
    const auto field = json_.find(name);
    if (field == json_.end() || !field->is_string() ||
        field->get_ref<const std::string&>().size() > max_length)
      return Fail(name, "a text of at most " + std::to_string(max_length) + " characters"), std::string();
    return field->get<std::string>();
  }
  Digest Hash(const char* name) {
    const std::optional<Digest> digest = Digest::FromHex(Text(name, 64));
    if (!digest) Fail(name, "64 hexadecimal digits");
    return digest.value_or(Digest{});
  }
  int Number(const char* name, int low, int high) {
    int value = 0;
    Keep(ReadNumber(json_, name, low, high, &value));
    return value;
  }
  void Keep(Status status) {
    if (status_.ok()) status_ = std::move(status);
  }
  void Fail(const std::string& name, const std::string& wanted) {
    Keep(BadInput("field '" + name + "' is not " + wanted));
  }
  const Status& status() const { return status_; }

 private:
  const Json& json_;
  Status status_;
};

/// A block, and behind it its vertices' home if one is known.
Status ParseTask(const Json& json, uint32_t columns, RoundManifest* manifest) {
  uint64_t numbers[5] = {};  // zero vertices, where there are none, are out of range below
  const bool fits =
      json.is_array() && (json.size() == 4 || json.size() == 5) &&
      std::all_of(json.begin(), json.end(), [](const Json& n) { return n.is_number_unsigned(); });
  for (size_t i = 0; fits && i < json.size(); ++i) numbers[i] = json[i].get<uint64_t>();
  const auto [first_vertex, vertices, first_column, block_columns, home] = numbers;
  const bool in_range = first_vertex < kNone && vertices > 0 && vertices <= kNone - first_vertex &&
                        first_column < columns && block_columns > 0 &&
                        block_columns <= columns - first_column && home < kMaxShards;
  if (!in_range) return BadInput("not [first vertex, vertices, first column, columns] within the grid");
  manifest->blocks.push_back({static_cast<uint32_t>(first_vertex), static_cast<uint32_t>(vertices),
                              static_cast<uint32_t>(first_column), static_cast<uint32_t>(block_columns)});
  manifest->homes.emplace_back();
  if (json.size() == 5) manifest->homes.back() = static_cast<uint32_t>(home);
  return {};
}

Status ParseTasks(const Json& json, RoundManifest* manifest) {
  const auto list = json.find("tasks");
  if (list == json.end() || !list->is_array() || list->empty())
    return BadInput("field 'tasks' is not a list");
  if (list->size() > kMaxRoundTasks) {
    return LimitExceeded(std::to_string(list->size()) + " tasks in a round, more than " +
                         std::to_string(kMaxRoundTasks) + "; make tasks larger");
  }
  const uint32_t columns = 10 * (1u << (2 * manifest->settings.grid_level)) + 2;
  for (const Json& entry : *list) {
    const Status parsed = ParseTask(entry, columns, manifest);
    if (!parsed.ok()) return parsed.WithContext("task " + std::to_string(manifest->blocks.size()));
  }
  return {};
}

}  // namespace

TaskSpec RoundManifest::Task(size_t index) const {
  return {TaskKey(Bake(), layer, blocks[index], previous), layer, blocks[index],
          homes.empty() ? std::nullopt : homes[index]};
}

Digest RoundManifest::InputKey() const {
  return Hasher().String("round input").Add(Bake()).Add(layer).Add(previous).Finish();
}

std::string ToJson(const RoundManifest& manifest) {
  Json json = {{"version", kVersion}, {"execution", manifest.execution}, {"scene", manifest.scene.Hex()}};
  json["settings"] = SettingsToJson(manifest.settings);
  json["layer"] = manifest.layer;
  json["previous"] = manifest.previous.Hex();
  Json& tasks = json["tasks"] = Json::array();
  for (size_t i = 0; i < manifest.blocks.size(); ++i) {
    const GatherBlock& b = manifest.blocks[i];
    tasks.push_back({b.first_vertex, b.vertices, b.first_column, b.columns});
    if (!manifest.homes.empty() && manifest.homes[i]) tasks.back().push_back(*manifest.homes[i]);
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<RoundManifest> ParseRoundManifest(std::span<const std::byte> text) {
  const auto* begin = reinterpret_cast<const char*>(text.data());
  const Json json = Json::parse(begin, begin + text.size(), nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return BadInput("not a round's manifest (a JSON object)");
  FieldReader in(json);
  in.Number("version", kVersion, kVersion);
  RoundManifest manifest;
  manifest.execution = in.Text("execution", kMaxExecution);
  manifest.scene = in.Hash("scene");
  manifest.layer = in.Number("layer", 0, kMaxLayer);
  manifest.previous = in.Hash("previous");
  GLINT_RETURN_IF_ERROR(in.status());
  const auto settings = json.find("settings");
  if (settings == json.end()) return BadInput("field 'settings' is missing");
  GLINT_ASSIGN_OR_RETURN(manifest.settings, SettingsFromJson(*settings));
  GLINT_RETURN_IF_ERROR(ParseTasks(json, &manifest));
  return manifest;
}

}  // namespace glint
