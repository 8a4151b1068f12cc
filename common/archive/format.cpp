// The archive's frame. Nothing in a file is believed before the checksum over it agrees, and nothing is
// computed from it without 64-bit bounds after that: a checksum stops accidents, not intent.
#include "common/archive/format.h"

#include <algorithm>

#include "common/domain/bake_settings.h"
#include "common/domain/direction_grid.h"
#include "common/lobes/brdf_table.h"

namespace glint::archive_format {
namespace {

/// Little-endian fields at fixed offsets.
template <class T>
void Put(std::byte* at, T value) {
  std::memcpy(at, &value, sizeof value);
}

template <class T>
T Get(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

bool AllZero(std::span<const std::byte> bytes) {
  return std::all_of(bytes.begin(), bytes.end(), [](std::byte b) { return b == std::byte{0}; });
}

constexpr const char* kTruncated = "it is truncated or damaged; copy it again, or bake it again";

/// Offsets in a record, documented in docs/archive-format.md.
void PutRecord(std::byte* at, const Section& s) {
  Put(at + 0, static_cast<uint32_t>(s.kind));
  Put(at + 4, static_cast<uint32_t>(s.codec));
  Put(at + 8, s.layer);
  Put(at + 12, s.slot);
  Put(at + 16, s.offset);
  Put(at + 24, s.stored_bytes);
  Put(at + 32, s.raw_bytes);
  Put(at + 40, s.checksum);
}

Result<Section> GetRecord(const std::byte* at) {
  Section s;
  const auto kind = Get<uint32_t>(at), codec = Get<uint32_t>(at + 4);
  if (kind < 1 || kind > static_cast<uint32_t>(Kind::kNodes) ||
      codec > static_cast<uint32_t>(Codec::kDraco)) {
    return BadInput("footer: unknown kind or coding of a section; a newer Glint may read it");
  }
  if (!AllZero({at + 48, 16})) return BadInput("footer: reserved bytes are set; a newer Glint may read it");
  s.kind = static_cast<Kind>(kind);
  s.codec = static_cast<Codec>(codec);
  s.layer = Get<uint32_t>(at + 8);
  s.slot = Get<uint32_t>(at + 12);
  s.offset = Get<uint64_t>(at + 16);
  s.stored_bytes = Get<uint64_t>(at + 24);
  s.raw_bytes = Get<uint64_t>(at + 32);
  s.checksum = Get<uint64_t>(at + 40);
  return s;
}

/// Sections lie one behind the other, each aligned, from the header to the footer, with zeros between.
Status CheckPlacement(std::span<const std::byte> file, std::span<const Section> sections, uint64_t end) {
  uint64_t at = kHeaderBytes;
  for (const Section& s : sections) {
    if (s.offset != at || s.stored_bytes > end - at) return BadInput("footer: misplaced section " + s.Name());
    const uint64_t section_end = at + s.stored_bytes;  // <= end, which is aligned
    at = Align(section_end);
    if (!AllZero(file.subspan(section_end, at - section_end))) {
      return BadInput("padding after section " + s.Name() + " is not zero: " + kTruncated);
    }
  }
  if (at != end) return BadInput("footer: sections do not end where it begins");
  return {};
}

}  // namespace

std::string Section::Name() const {
  switch (kind) {
    case Kind::kGeometry:
      return "geometry";
    case Kind::kVertices:
      return "vertices";
    case Kind::kShapes:
      return "shapes";
    case Kind::kCameras:
      return "cameras";
    case Kind::kReport:
      return "report";
    case Kind::kNodes:
      return "nodes";
    case Kind::kTable:
      return "table " + std::to_string(layer) + "/" + std::to_string(slot);
  }
  return "unknown";
}

std::array<std::byte, kHeaderBytes> EncodeHeader(const Header& header) {
  std::array<std::byte, kHeaderBytes> out{};
  std::byte* at = out.data();
  std::memcpy(at, kMagic.data(), kMagic.size());
  Put(at + kVersionOffset, kVersion);
  Put(at + 12, static_cast<uint32_t>(kHeaderBytes));
  Put(at + 16, header.grid_level);
  Put(at + 20, header.layers);
  Put(at + 24, header.slots);
  Put(at + 28, header.slice_lobes);
  Put(at + 32, header.vertices);
  Put(at + 40, header.triangles);
  std::memcpy(at + 48, header.archive_key.bytes.data(), header.archive_key.bytes.size());
  Put(at + 80, header.base_level);
  Put(at + 84, header.direct_lobes - 1);
  Put(at + 88, header.rows);
  Put(at + kHeaderChecksumOffset, Checksum64({at, kHeaderChecksumOffset}));
  return out;
}

Result<Header> DecodeHeader(std::span<const std::byte> file) {
  if (file.size() < kMagic.size() || std::memcmp(file.data(), kMagic.data(), kMagic.size()) != 0) {
    return BadInput("not a Glint archive (its first bytes are wrong); give a file that `glint bake` wrote");
  }
  if (file.size() < kHeaderBytes + kTailBytes) return BadInput(std::string("too short: ") + kTruncated);
  const std::byte* at = file.data();
  const auto version = Get<uint32_t>(at + kVersionOffset);
  if (version != kVersion) {
    return BadInput("header: format version " + std::to_string(version) + ", this program reads version " +
                    std::to_string(kVersion) + "; bake it again with this program");
  }
  if (Get<uint64_t>(at + kHeaderChecksumOffset) != Checksum64({at, kHeaderChecksumOffset})) {
    return BadInput(std::string("header: checksum differs: ") + kTruncated);
  }
  Header header;
  header.grid_level = Get<uint32_t>(at + 16);
  header.layers = Get<uint32_t>(at + 20);
  header.slots = Get<uint32_t>(at + 24);
  header.slice_lobes = Get<uint32_t>(at + 28);
  header.vertices = Get<uint64_t>(at + 32);
  header.triangles = Get<uint64_t>(at + 40);
  std::memcpy(header.archive_key.bytes.data(), at + 48, header.archive_key.bytes.size());
  header.base_level = Get<uint32_t>(at + 80);
  const auto further_direct = Get<uint32_t>(at + 84);
  header.rows = Get<uint64_t>(at + 88);
  if (Get<uint32_t>(at + 12) != kHeaderBytes || !AllZero({at + 96, 24})) {
    return BadInput("header: reserved bytes are set; a newer Glint may read it");
  }
  if (header.grid_level > DirectionGrid::kMaxLevel || header.base_level > header.grid_level ||
      header.layers > kMaxLayers || header.slots > static_cast<uint32_t>(kMaxBrdfLobes) ||
      header.slice_lobes < 1 || header.slice_lobes > static_cast<uint32_t>(kMaxSliceLobes) ||
      further_direct >= header.slice_lobes || header.vertices > kMaxVertices ||
      header.triangles > kMaxTriangles || header.rows > kMaxVertices) {
    return BadInput("header: a count is out of range; bake it again");
  }
  header.direct_lobes = further_direct + 1;
  return header;
}

std::vector<std::byte> EncodeFooter(std::span<const Section> sections, std::span<const std::byte> header,
                                    uint64_t end) {
  std::vector<std::byte> out(sections.size() * kRecordBytes + kTailBytes);
  for (size_t i = 0; i < sections.size(); ++i) PutRecord(out.data() + i * kRecordBytes, sections[i]);
  std::byte* tail = out.data() + sections.size() * kRecordBytes;
  std::memcpy(tail, kEndMagic.data(), kEndMagic.size());
  Put(tail + 8, end);
  Put(tail + 16, static_cast<uint32_t>(sections.size()));
  Put(tail + 20, kVersion);
  Put(tail + 24, end + out.size());
  Put(tail + 32, Checksum64(header));
  Put(tail + 40, Checksum64({out.data(), sections.size() * kRecordBytes}));
  Put(tail + 56, Checksum64({tail, 56}));
  return out;
}

Result<std::vector<Section>> DecodeFooter(std::span<const std::byte> file) {
  const std::byte* tail = file.data() + file.size() - kTailBytes;
  if (std::memcmp(tail, kEndMagic.data(), kEndMagic.size()) != 0 ||
      Get<uint64_t>(tail + 56) != Checksum64({tail, 56})) {
    return BadInput(std::string("footer: not found at the end of the file: ") + kTruncated);
  }
  const auto end = Get<uint64_t>(tail + 8);
  const uint64_t count = Get<uint32_t>(tail + 16);
  if (Get<uint64_t>(tail + 24) != file.size() || Get<uint32_t>(tail + 20) != kVersion ||
      !AllZero({tail + 48, 8}) || count > kMaxSections || end % kAlignment != 0 || end < kHeaderBytes ||
      end > file.size() || file.size() - end != count * kRecordBytes + kTailBytes) {
    return BadInput(std::string("footer: sizes do not agree with the file: ") + kTruncated);
  }
  if (Get<uint64_t>(tail + 32) != Checksum64(file.first(kHeaderBytes))) {
    return BadInput(std::string("header: is not the one that the footer was written for: ") + kTruncated);
  }
  if (Get<uint64_t>(tail + 40) != Checksum64(file.subspan(end, count * kRecordBytes))) {
    return BadInput(std::string("footer: checksum of the section records differs: ") + kTruncated);
  }
  std::vector<Section> sections;
  for (uint64_t i = 0; i < count; ++i) {
    GLINT_ASSIGN_OR_RETURN(Section section, GetRecord(file.data() + end + i * kRecordBytes));
    sections.push_back(section);
  }
  GLINT_RETURN_IF_ERROR(CheckPlacement(file, sections, end));
  return sections;
}

}  // namespace glint::archive_format
