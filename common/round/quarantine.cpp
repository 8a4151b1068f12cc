#include "common/round/quarantine.h"

#include <nlohmann/json.hpp>
#include <span>
#include <system_error>

#include "common/base/files.h"
#include "common/round/round_files.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr uint64_t kMaxRecordBytes = uint64_t{1} << 20;

std::string Text(const Json& json, const char* name) {
  const auto field = json.find(name);
  return field != json.end() && field->is_string() ? field->get<std::string>() : std::string();
}
int64_t Number(const Json& json, const char* name) {
  const auto field = json.find(name);
  return field != json.end() && field->is_number_integer() ? field->get<int64_t>() : 0;
}

}  // namespace

Status WriteQuarantine(const fs::path& bake, const Digest& task_key, const QuarantineRecord& record) {
  const Json json = {{"task", record.task},
                     {"layer", record.layer},
                     {"deliveries", record.deliveries},
                     {"reason", record.reason},
                     {"error_output", record.error_output},
                     {"command", record.command}};
  const std::string text = json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
  const fs::path path = QuarantinePath(bake, task_key);
  GLINT_RETURN_IF_ERROR(CreateFolders(path.parent_path()));
  return PublishFile(path, std::as_bytes(std::span(text)));
}

std::optional<QuarantineRecord> ReadQuarantine(const fs::path& bake, const Digest& task_key) {
  const fs::path path = QuarantinePath(bake, task_key);
  std::error_code error;
  if (!fs::exists(path, error)) return std::nullopt;
  const Result<std::vector<std::byte>> bytes = ReadFile(path, kMaxRecordBytes);
  QuarantineRecord record;
  record.reason = "its record " + path.string() + " cannot be read";
  if (!bytes.ok()) return record;
  const auto* begin = reinterpret_cast<const char*>(bytes->data());
  const Json json = Json::parse(begin, begin + bytes->size(), nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return record;
  record.task = static_cast<uint64_t>(Number(json, "task"));
  record.layer = static_cast<int>(Number(json, "layer"));
  record.deliveries = static_cast<int>(Number(json, "deliveries"));
  record.reason = Text(json, "reason");
  record.error_output = Text(json, "error_output");
  record.command = Text(json, "command");
  return record;
}

void ForgetQuarantine(const fs::path& bake, const Digest& task_key) {
  std::error_code ignored;
  fs::remove(QuarantinePath(bake, task_key), ignored);
}

}  // namespace glint
