#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/archive/slice_table.h"
#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/domain/bake_settings.h"
#include "coordinator/bake.h"

namespace glint {

/// What a client asks for.
struct BakeRequest {
  std::string key;  ///< the client's; empty: the request itself is the key
  Digest scene;     ///< of the file's bytes
  std::string name;
  BakeSettings settings;
  BakeTarget target;  ///< BakeOptions::target
  int max_layers = 16;
  float layer_tolerance = 0.01f;
  TableForm table_form = kDefaultTableForm;
  std::optional<uint32_t> estimate_slices;  ///< BakeOptions::estimate_slices
  uint32_t vertices_per_task = 0, directions_per_task = 0;
  int priority = 1;
};

enum class BakeState { kQueued = 1, kRunning = 2, kDone = 3, kFailed = 4, kCancelled = 5 };

/// What the service must not forget of a bake.
struct JournalEntry {
  std::string id;
  BakeRequest request;
  BakeState state = BakeState::kQueued;
  Status error;                ///< kFailed: why
  std::string bake_key;        ///< hexadecimal, once it is known; its folder in the store
  int64_t submitted_unix = 0;  ///< seconds
};

/// The service's memory: one SQLite file. Every call is durable when it returns, and safe to repeat.
class Journal {
 public:
  /// kIo; kBadInput: the file is damaged or of another version.
  static Result<Journal> Open(const std::filesystem::path& path);
  Journal(Journal&&) noexcept;
  ~Journal();

  /// All entries, the oldest first.
  Result<std::vector<JournalEntry>> Load() const;
  Status Put(const JournalEntry& entry);
  Status Remove(const std::string& id);

 private:
  struct Database;
  explicit Journal(std::unique_ptr<Database> database);
  std::unique_ptr<Database> database_;
};

/// One JSON object; what ParseRequest gives back. It says everything about a request.
std::string ToJson(const BakeRequest& request);
/// kBadInput naming the field.
Result<BakeRequest> ParseRequest(const std::string& json);

}  // namespace glint
