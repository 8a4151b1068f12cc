#include "coordinator/service/journal.h"

#include <sqlite3.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/queue/task_queue.h"
#include "common/round/json_field.h"
#include "common/round/settings_json.h"
#include "coordinator/error_estimate.h"

namespace glint {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kVersion = 1;  ///< of the file, as SQLite's user_version
constexpr size_t kMaxText = 256;
constexpr int kMaxLayers = 255;
constexpr int kBusyMs = 10'000;

struct StatementDeleter {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, StatementDeleter>;

std::string Column(sqlite3_stmt* row, int column) {
  const unsigned char* text = sqlite3_column_text(row, column);
  return text ? reinterpret_cast<const char*>(text) : "";
}

Status ReadText(const Json& json, const char* name, std::string* out) {
  const auto field = json.find(name);
  if (field == json.end() || !field->is_string() || field->get_ref<const std::string&>().size() > kMaxText) {
    return BadInput("field '" + std::string(name) + "' is not a text of at most " + std::to_string(kMaxText) +
                    " characters");
  }
  *out = field->get<std::string>();
  return {};
}

Json TargetToJson(const BakeTarget& target) {
  Json json = {{"tolerance", target.tolerance},
               {"max_seconds", target.max_seconds},
               {"max_bytes", target.max_bytes},
               {"fixed", Json::array()}};
  for (size_t a = 0; a < target.fixed.size(); ++a)
    if (target.fixed[a]) json["fixed"].push_back(kBakeAxisNames[a]);
  return json;
}

Result<BakeTarget> TargetFromJson(const Json& json) {
  if (!json.is_object()) return BadInput("field 'target' is not a JSON object");
  BakeTarget target;
  GLINT_RETURN_IF_ERROR(ReadNumber(json, "tolerance", 0.0f, 1.0f, &target.tolerance));
  GLINT_RETURN_IF_ERROR(ReadNumber(json, "max_seconds", 0.0, kMaxTargetSeconds, &target.max_seconds));
  GLINT_RETURN_IF_ERROR(
      ReadNumber(json, "max_bytes", uint64_t{0}, std::numeric_limits<uint64_t>::max(), &target.max_bytes));
  const auto fixed = json.find("fixed");
  if (fixed == json.end() || !fixed->is_array()) return BadInput("field 'fixed' is not a list");
  for (const Json& name : *fixed) {
    const auto axis = std::find(kBakeAxisNames.begin(), kBakeAxisNames.end(), name);
    if (axis == kBakeAxisNames.end()) return BadInput("field 'fixed' names what is no axis");
    target.fixed[static_cast<size_t>(axis - kBakeAxisNames.begin())] = true;
  }
  return target;
}

}  // namespace

struct Journal::Database {
  explicit Database(std::string name) : path(std::move(name)) {}
  ~Database() { sqlite3_close(handle); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  Status Failed() const {
    const int code = sqlite3_errcode(handle);
    const std::string message = path + ": " + sqlite3_errmsg(handle);
    if (code == SQLITE_CORRUPT || code == SQLITE_NOTADB)
      return BadInput(message + "; put a copy in its place, or remove it and submit the bakes again");
    return IoError(message);
  }
  Status Execute(const char* sql) {
    return sqlite3_exec(handle, sql, nullptr, nullptr, nullptr) == SQLITE_OK ? Status() : Failed();
  }
  Result<Statement> Prepare(const char* sql) const {
    sqlite3_stmt* made = nullptr;
    if (sqlite3_prepare_v2(handle, sql, -1, &made, nullptr) != SQLITE_OK) return Failed();
    return Statement(made);
  }
  Result<int> UserVersion() {
    GLINT_ASSIGN_OR_RETURN(const Statement query, Prepare("PRAGMA user_version"));
    if (sqlite3_step(query.get()) != SQLITE_ROW) return Failed();
    return sqlite3_column_int(query.get(), 0);
  }

  const std::string path;
  sqlite3* handle = nullptr;
};

Journal::Journal(std::unique_ptr<Database> database) : database_(std::move(database)) {}
Journal::Journal(Journal&&) noexcept = default;
Journal::~Journal() = default;

Result<Journal> Journal::Open(const std::filesystem::path& path) {
  auto database = std::make_unique<Database>(path.string());
  if (sqlite3_open(path.c_str(), &database->handle) != SQLITE_OK) return database->Failed();
  sqlite3_busy_timeout(database->handle, kBusyMs);
  // A rollback journal, not a write-ahead log: the store may lie on a network file system.
  GLINT_RETURN_IF_ERROR(database->Execute("PRAGMA journal_mode = DELETE; PRAGMA synchronous = FULL"));
  GLINT_ASSIGN_OR_RETURN(const int version, database->UserVersion());
  if (version != 0 && version != kVersion) {
    return BadInput(path.string() + ": version " + std::to_string(version) + " is not this program's (" +
                    std::to_string(kVersion) + "); use the program that wrote it");
  }
  GLINT_RETURN_IF_ERROR(database->Execute(
      "BEGIN IMMEDIATE;"
      "CREATE TABLE IF NOT EXISTS bakes (id TEXT PRIMARY KEY, request TEXT NOT NULL, state INTEGER NOT NULL,"
      " error_kind INTEGER NOT NULL, error TEXT NOT NULL, bake_key TEXT NOT NULL, submitted INTEGER NOT "
      "NULL);"
      "PRAGMA user_version = 1;"
      "COMMIT"));
  return Journal(std::move(database));
}

Result<std::vector<JournalEntry>> Journal::Load() const {
  GLINT_ASSIGN_OR_RETURN(
      const Statement query,
      database_->Prepare("SELECT id, request, state, error_kind, error, bake_key, submitted "
                         "FROM bakes ORDER BY submitted, rowid"));
  std::vector<JournalEntry> entries;
  for (;;) {
    const int step = sqlite3_step(query.get());
    if (step == SQLITE_DONE) return entries;
    if (step != SQLITE_ROW) return database_->Failed();
    JournalEntry entry;
    entry.id = Column(query.get(), 0);
    Result<BakeRequest> request = ParseRequest(Column(query.get(), 1));
    if (!request.ok()) return request.status().WithContext(database_->path + ": bake " + entry.id);
    entry.request = std::move(request).value();
    entry.state = static_cast<BakeState>(sqlite3_column_int(query.get(), 2));
    const auto kind = static_cast<ErrorKind>(sqlite3_column_int(query.get(), 3));
    if (kind != ErrorKind::kOk) entry.error = Status(kind, Column(query.get(), 4));
    entry.bake_key = Column(query.get(), 5);
    entry.submitted_unix = sqlite3_column_int64(query.get(), 6);
    entries.push_back(std::move(entry));
  }
}

Status Journal::Put(const JournalEntry& entry) {
  GLINT_ASSIGN_OR_RETURN(
      const Statement put,
      database_->Prepare(
          "INSERT INTO bakes (id, request, state, error_kind, error, bake_key, submitted) "
          "VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO UPDATE SET state = excluded.state, "
          "error_kind = excluded.error_kind, error = excluded.error, "
          "bake_key = excluded.bake_key"));
  const std::string request = ToJson(entry.request);
  const auto bind_text = [&](int index, const std::string& text) {
    sqlite3_bind_text(put.get(), index, text.data(), static_cast<int>(text.size()), SQLITE_STATIC);
  };
  bind_text(1, entry.id);
  bind_text(2, request);
  sqlite3_bind_int(put.get(), 3, static_cast<int>(entry.state));
  sqlite3_bind_int(put.get(), 4, static_cast<int>(entry.error.kind()));
  bind_text(5, entry.error.message());
  bind_text(6, entry.bake_key);
  sqlite3_bind_int64(put.get(), 7, entry.submitted_unix);
  return sqlite3_step(put.get()) == SQLITE_DONE ? Status() : database_->Failed();
}

Status Journal::Remove(const std::string& id) {
  GLINT_ASSIGN_OR_RETURN(const Statement remove, database_->Prepare("DELETE FROM bakes WHERE id = ?"));
  sqlite3_bind_text(remove.get(), 1, id.data(), static_cast<int>(id.size()), SQLITE_STATIC);
  return sqlite3_step(remove.get()) == SQLITE_DONE ? Status() : database_->Failed();
}

std::string ToJson(const BakeRequest& request) {
  Json json = {{"key", request.key},
               {"scene", request.scene.Hex()},
               {"name", request.name},
               {"settings", SettingsToJson(request.settings)},
               {"max_layers", request.max_layers},
               {"layer_tolerance", request.layer_tolerance},
               {"table_form", static_cast<int>(request.table_form)},
               {"vertices_per_task", request.vertices_per_task},
               {"directions_per_task", request.directions_per_task},
               {"priority", request.priority}};
  if (request.target.active()) json["target"] = TargetToJson(request.target);
  if (request.estimate_slices) json["estimate_slices"] = *request.estimate_slices;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Result<BakeRequest> ParseRequest(const std::string& text) {
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return BadInput("a request is not a JSON object");
  BakeRequest request;
  GLINT_RETURN_IF_ERROR(ReadText(json, "key", &request.key));
  GLINT_RETURN_IF_ERROR(ReadText(json, "name", &request.name));
  std::string scene;
  GLINT_RETURN_IF_ERROR(ReadText(json, "scene", &scene));
  const std::optional<Digest> digest = Digest::FromHex(scene);
  if (!digest) return BadInput("field 'scene' is not a digest");
  request.scene = *digest;
  const auto settings = json.find("settings");
  if (settings == json.end()) return BadInput("field 'settings' is missing");
  GLINT_ASSIGN_OR_RETURN(request.settings, SettingsFromJson(*settings));
  constexpr uint32_t kAny = std::numeric_limits<uint32_t>::max();
  int form = 0;
  GLINT_RETURN_IF_ERROR(ReadNumber(json, "max_layers", 0, kMaxLayers, &request.max_layers));
  GLINT_RETURN_IF_ERROR(ReadNumber(json, "layer_tolerance", 0.0f, 1.0f, &request.layer_tolerance));
  GLINT_RETURN_IF_ERROR(ReadNumber(json, "table_form", 0, 1, &form));
  GLINT_RETURN_IF_ERROR(ReadNumber(json, "vertices_per_task", 0u, kAny, &request.vertices_per_task));
  GLINT_RETURN_IF_ERROR(ReadNumber(json, "directions_per_task", 0u, kAny, &request.directions_per_task));
  GLINT_RETURN_IF_ERROR(ReadNumber(json, "priority", 1, kMaxPriority, &request.priority));
  request.table_form = static_cast<TableForm>(form);
  if (json.contains("target")) {
    GLINT_ASSIGN_OR_RETURN(request.target, TargetFromJson(json["target"]));
  }
  if (json.contains("estimate_slices")) {
    constexpr auto kMost = static_cast<uint32_t>(kMaxEstimateSlices);
    GLINT_RETURN_IF_ERROR(ReadNumber(json, "estimate_slices", 0u, kMost, &request.estimate_slices.emplace()));
  }
  return request;
}

}  // namespace glint
