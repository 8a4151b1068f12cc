#include "tools/chart/record.h"

#include <span>
#include <string>
#include <utility>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/render/image_codecs.h"

namespace glint::chart {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr uint64_t kMaxNumbersBytes = uint64_t{16} << 20;
constexpr uint64_t kMaxPictureBytes = uint64_t{4} << 30;

std::string Text(const Json& json) { return json.dump(1, '\t', false, Json::error_handler_t::replace); }

/// What vouches for the numbers: the picture's digest is one of them, so a record is whole or damaged.
std::string Seal(const Digest& key, const Json& body) {
  return Hasher().String("glint chart record").Add(key).String(Text(body)).Finish().Hex();
}

}  // namespace

Result<RecordStore> RecordStore::Open(const fs::path& folder) {
  GLINT_RETURN_IF_ERROR(CreateFolders(folder));
  return RecordStore(folder);
}

fs::path RecordStore::NumbersPath(const Digest& key) const { return folder_ / (key.Hex() + ".json"); }
fs::path RecordStore::PicturePath(const Digest& key) const { return folder_ / (key.Hex() + ".exr"); }

std::optional<Record> RecordStore::Find(const Digest& key) const {
  std::error_code error;
  if (!fs::exists(NumbersPath(key), error)) return std::nullopt;
  Result<Record> record = Read(key);
  if (record.ok()) return std::move(record).value();
  Log(LogLevel::kWarning, record.status().message() + "; it is computed again");
  return std::nullopt;
}

Result<Record> RecordStore::Read(const Digest& key) const {
  const fs::path path = NumbersPath(key);
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, kMaxNumbersBytes));
  const char* const text = reinterpret_cast<const char*>(bytes.data());
  const Json file = Json::parse(text, text + bytes.size(), nullptr, false);
  if (!file.is_object() || !file.contains("seal") || !file.contains("record")) {
    return BadInput(path.string() + ": damaged: not a chart's record");
  }
  const Json& body = file["record"];
  if (file["seal"] != Seal(key, body) || !body.is_object() || !body.contains("picture_sha256") ||
      !body.contains("numbers")) {
    return BadInput(path.string() + ": damaged: its numbers are not those that were written");
  }
  const fs::path picture_path = PicturePath(key);
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> picture, ReadFile(picture_path, kMaxPictureBytes));
  if (body["picture_sha256"] != Sha256(picture).Hex()) {
    return BadInput(picture_path.string() + ": damaged: not the picture that was written");
  }
  Record record;
  record.numbers = body["numbers"];
  GLINT_ASSIGN_OR_RETURN(record.picture, ReadPictureFromMemory(picture, picture_path.string()));
  return record;
}

Status RecordStore::Put(const Digest& key, const Record& record) const {
  const fs::path picture_path = PicturePath(key);
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> picture,
                         codec::EncodeExr(record.picture, picture_path.string(), true));
  GLINT_RETURN_IF_ERROR(PublishFile(picture_path, picture));
  // Through text once, so that the seal is of what a reader will find.
  const Json body = Json::parse(
      Text({{"numbers", record.numbers}, {"picture_sha256", Sha256(picture).Hex()}}), nullptr, false);
  const std::string text = Text({{"record", body}, {"seal", Seal(key, body)}}) + "\n";
  return PublishFile(NumbersPath(key), std::as_bytes(std::span(text)));
}

}  // namespace glint::chart
