#include "common/store/store.h"

#include <array>
#include <bit>
#include <charconv>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>

#include "common/base/files.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little,
              "chunks are little-endian and written as they lie in memory");

/// At the start of every chunk; 32 bytes, little-endian, followed by the payload and nothing else.
struct ChunkHeader {
  std::array<char, 8> magic{'G', 'L', 'C', 'H', 'U', 'N', 'K', '\n'};  // offset 0
  uint32_t version = 1;                                                // offset 8
  uint32_t reserved = 0;                                               // offset 12
  uint64_t payload_bytes = 0;                                          // offset 16
  uint64_t checksum = 0;                                               // offset 24: XXH3 of the payload
};
static_assert(sizeof(ChunkHeader) == 32);

constexpr uint64_t kMaxChunkBytes = uint64_t{16} << 30;
constexpr double kMicroseconds = 1e6;

/// What a task's file says: "<digest> <microseconds> <line> <XXH3 of what is before>\n", hexadecimal.
struct Record {
  Digest chunk;
  uint64_t microseconds = 0;
  uint64_t line = kNoLine;
  static constexpr uint64_t kNoLine = UINT64_MAX;

  Record() = default;
  Record(const Digest& result, const TaskNote& note)
      : chunk(result),
        microseconds(static_cast<uint64_t>(std::llround(note.seconds * kMicroseconds))),
        line(note.home ? *note.home : kNoLine) {}
  TaskNote Note() const {
    TaskNote note{static_cast<double>(microseconds) / kMicroseconds, {}};
    if (line <= UINT32_MAX) note.home = static_cast<uint32_t>(line);
    return note;
  }
};
constexpr size_t kDigestDigits = 64, kNumberDigits = 16;
constexpr size_t kCheckedBytes = kDigestDigits + 2 * (1 + kNumberDigits);
constexpr uint64_t kRecordBytes = kCheckedBytes + 1 + kNumberDigits + 1;

fs::path ShardedPath(const fs::path& root, const char* kind, const Digest& digest) {
  const std::string hex = digest.Hex();
  return root / kind / hex.substr(0, 2) / hex;
}
fs::path ChunkPath(const fs::path& root, const Digest& digest) { return ShardedPath(root, "chunks", digest); }
fs::path RecordPath(const fs::path& root, const Digest& key) { return ShardedPath(root, "tasks", key); }

std::string HexNumber(uint64_t number) {
  char text[kNumberDigits + 1];
  std::snprintf(text, sizeof text, "%016" PRIx64, number);
  return text;
}

std::string ToText(const Record& record) {
  const std::string checked =
      record.chunk.Hex() + " " + HexNumber(record.microseconds) + " " + HexNumber(record.line);
  return checked + " " + HexNumber(Checksum64(std::as_bytes(std::span(checked)))) + "\n";
}

/// None if it is not exactly what PutResult writes.
std::optional<Record> ParseRecord(std::span<const std::byte> bytes) {
  if (bytes.size() != kRecordBytes) return std::nullopt;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::optional<Digest> chunk = Digest::FromHex(text.substr(0, kDigestDigits));
  Record record;
  const char* number = text.data() + kDigestDigits + 1;
  std::from_chars(number, number + kNumberDigits, record.microseconds, 16);
  number += kNumberDigits + 1;
  std::from_chars(number, number + kNumberDigits, record.line, 16);
  if (chunk) record.chunk = *chunk;
  return chunk && ToText(record) == text ? std::optional(record) : std::nullopt;
}

/// The record of a task whose chunk is there.
std::optional<Record> FindRecord(const fs::path& root, const Digest& task_key) {
  const auto bytes = ReadFile(RecordPath(root, task_key), kRecordBytes);
  if (!bytes.ok()) return std::nullopt;
  const std::optional<Record> record = ParseRecord(*bytes);
  std::error_code error;
  if (!record || !fs::is_regular_file(ChunkPath(root, record->chunk), error)) return std::nullopt;
  return record;
}

Status PublishChunk(const fs::path& path, std::span<const std::byte> payload) {
  ChunkHeader header;
  header.payload_bytes = payload.size();
  header.checksum = Checksum64(payload);
  GLINT_RETURN_IF_ERROR(CreateFolders(path.parent_path()));
  GLINT_ASSIGN_OR_RETURN(FilePublisher publisher, FilePublisher::Create(path));
  GLINT_RETURN_IF_ERROR(publisher.Write(std::as_bytes(std::span(&header, 1))));
  GLINT_RETURN_IF_ERROR(publisher.Write(payload));
  return publisher.Commit();
}

/// What is wrong with a chunk's bytes; empty: nothing.
std::string FindDamage(std::span<const std::byte> bytes, const Digest& digest) {
  if (bytes.size() < sizeof(ChunkHeader)) return "shorter than a chunk's header";
  ChunkHeader header;
  std::memcpy(&header, bytes.data(), sizeof header);
  const std::span<const std::byte> payload = bytes.subspan(sizeof header);
  const ChunkHeader expected;
  if (header.magic != expected.magic) return "not a chunk (wrong magic)";
  if (header.version != expected.version)
    return "chunk version " + std::to_string(header.version) + " is not known";
  if (header.reserved != 0) return "damaged header";
  if (header.payload_bytes != payload.size()) {
    return std::to_string(payload.size()) + " bytes of payload where its header says " +
           std::to_string(header.payload_bytes);
  }
  if (header.checksum != Checksum64(payload)) return "wrong checksum";
  if (Sha256(payload) != digest) return "the content is not the one that the name promises";
  return "";
}

/// A chunk that is gone, or larger than any, is computed again. One that cannot be read now (permissions, too
/// many open files, a disk that fails) may be sound.
Status WhyUnread(const fs::path& path, const Status& status) {
  std::error_code error;
  const bool gone = fs::symlink_status(path, error).type() == fs::file_type::not_found;
  if (gone || status.kind() == ErrorKind::kLimit) return BadInput(status.message());
  return IoError(status.message() + "; mend that, or remove the file, and its task is computed again");
}

Status RemoveFile(const fs::path& path) {
  std::error_code error;
  fs::remove(path, error);
  return error ? IoError(path.string() + ": cannot remove: " + error.message()) : Status();
}

}  // namespace

Result<ChunkStore> ChunkStore::Open(const fs::path& root) {
  GLINT_RETURN_IF_ERROR(CreateFolders(root / "chunks"));
  GLINT_RETURN_IF_ERROR(CreateFolders(root / "tasks"));
  return ChunkStore(root);
}

std::optional<Digest> ChunkStore::FindResult(const Digest& task_key) const {
  const std::optional<Record> record = FindRecord(root_, task_key);
  return record ? std::optional(record->chunk) : std::nullopt;
}

std::optional<TaskNote> ChunkStore::FindNote(const Digest& task_key) const {
  const std::optional<Record> record = FindRecord(root_, task_key);
  return record ? std::optional(record->Note()) : std::nullopt;
}

Result<Digest> ChunkStore::PutResult(const Digest& task_key, std::span<const std::byte> payload,
                                     const TaskNote& note) {
  const Record record(Sha256(payload), note);
  // The chunk first: a record never points to what is not durable yet.
  GLINT_RETURN_IF_ERROR(PublishChunk(ChunkPath(root_, record.chunk), payload));
  const std::string text = ToText(record);
  const fs::path record_path = RecordPath(root_, task_key);
  GLINT_RETURN_IF_ERROR(CreateFolders(record_path.parent_path()));
  GLINT_RETURN_IF_ERROR(PublishFile(record_path, std::as_bytes(std::span(text))));
  return record.chunk;
}

Result<std::vector<std::byte>> ChunkStore::Get(const Digest& digest) const {
  const fs::path path = ChunkPath(root_, digest);
  Result<std::vector<std::byte>> read = ReadFile(path, kMaxChunkBytes);
  if (!read.ok()) return WhyUnread(path, read.status());
  std::vector<std::byte> bytes = std::move(read).value();
  if (const std::string damage = FindDamage(bytes, digest); !damage.empty()) {
    return BadInput(path.string() + ": damaged chunk, " + damage +
                    "; remove the file, and its task is computed again");
  }
  bytes.erase(bytes.begin(), bytes.begin() + sizeof(ChunkHeader));
  return bytes;
}

Status ChunkStore::Discard(const Digest& task_key, const Digest& digest) {
  GLINT_RETURN_IF_ERROR(RemoveFile(RecordPath(root_, task_key)));
  // Another process may have put a sound chunk in its place since the damage was seen: that one stays.
  Status chunk = Get(digest).status();
  if (chunk.ok() || chunk.kind() == ErrorKind::kIo) return chunk;
  return RemoveFile(ChunkPath(root_, digest));
}

}  // namespace glint
