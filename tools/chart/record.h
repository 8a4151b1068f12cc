#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/render/image.h"

namespace glint::chart {

/// The result of one piece of a chart's work: what was measured, and a picture.
struct Record {
  nlohmann::ordered_json numbers;  ///< an object
  Picture picture;
};

/// Records in a folder by key: KEY.exr, the picture in full precision, and then KEY.json, the numbers with
/// the SHA-256 of the picture's file and of themselves. Both are published atomically; a record is there once
/// its KEY.json is. Nothing is ever changed: another setting is another key.
class RecordStore {
 public:
  static Result<RecordStore> Open(const std::filesystem::path& folder);

  /// The record, or nothing if there is none or it is damaged; damage is said as a warning.
  std::optional<Record> Find(const Digest& key) const;
  Status Put(const Digest& key, const Record& record) const;

  std::filesystem::path NumbersPath(const Digest& key) const;
  std::filesystem::path PicturePath(const Digest& key) const;

 private:
  explicit RecordStore(std::filesystem::path folder) : folder_(std::move(folder)) {}
  Result<Record> Read(const Digest& key) const;
  std::filesystem::path folder_;
};

}  // namespace glint::chart
