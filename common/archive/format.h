#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "common/base/hash.h"
#include "common/base/status.h"

namespace glint::archive_format {

// The archive's frame: where sections lie and how they are checked. Bytes: docs/archive-format.md.

inline constexpr std::array<char, 8> kMagic = {'G', 'L', 'I', 'N', 'T', '\r', '\n', '\x1a'};
inline constexpr std::array<char, 8> kEndMagic = {'G', 'L', 'I', 'N', 'T', 'E', 'N', 'D'};
inline constexpr uint32_t kVersion = 4;

inline constexpr uint64_t kHeaderBytes = 128;
inline constexpr uint64_t kVersionOffset = 8;           ///< in the header
inline constexpr uint64_t kHeaderChecksumOffset = 120;  ///< in the header: checksum of the bytes before it
inline constexpr uint64_t kRecordBytes = 64;            ///< one section's record in the footer
inline constexpr uint64_t kTailBytes = 64;              ///< the file's last bytes
inline constexpr uint64_t kAlignment = 64;

inline constexpr uint32_t kMaxSections = 8192;
inline constexpr uint32_t kMaxLayers = 256;
inline constexpr uint64_t kMaxVertices = 64'000'000;
inline constexpr uint64_t kMaxTriangles = 128'000'000;
/// Of the compressed sections whose size does not follow from the counts of vertices and triangles.
inline constexpr uint64_t kMaxVariableBytes = uint64_t{64} << 20;

enum class Kind : uint32_t {
  kGeometry = 1,
  kVertices = 2,
  kShapes = 3,
  kCameras = 4,
  kReport = 5,
  kTable = 6,
  kNodes = 7
};
enum class Codec : uint32_t { kRaw = 0, kZstd = 1, kDraco = 2 };

/// What precedes the sections.
struct Header {
  uint32_t grid_level = 0, base_level = 0;
  uint32_t layers = 0;
  uint32_t slots = 0;  ///< specular tables of each layer; one diffuse table follows them
  /// Sets of such tables of layers above 0, and of layer 0: first lobes of the slices, second, ...
  uint32_t slice_lobes = 1, direct_lobes = 1;
  uint64_t vertices = 0, triangles = 0, rows = 0;
  Digest archive_key;

  /// Tables of a layer: for each lobe of a slice, the specular slots', then the diffuse one.
  uint32_t tables(uint32_t layer) const { return (slots + 1) * (layer == 0 ? direct_lobes : slice_lobes); }
  bool is_diffuse(uint32_t table) const { return table % (slots + 1) == slots; }
};

/// One section's record in the footer.
struct Section {
  Kind kind = Kind::kGeometry;
  Codec codec = Codec::kRaw;
  uint32_t layer = 0, slot = 0;  ///< of tables
  uint64_t offset = 0, stored_bytes = 0, raw_bytes = 0, checksum = 0;

  std::string Name() const;
};

inline uint64_t Align(uint64_t n) { return (n + kAlignment - 1) & ~(kAlignment - 1); }

std::array<std::byte, kHeaderBytes> EncodeHeader(const Header& header);
/// Checks magic, version, checksum, reserved bytes and ranges.
Result<Header> DecodeHeader(std::span<const std::byte> file);

/// Records and tail; `end` is where they begin, a multiple of 64.
std::vector<std::byte> EncodeFooter(std::span<const Section> sections, std::span<const std::byte> header,
                                    uint64_t end);
/// Checks the tail, the records, that sections follow one another without gaps or overlaps, and that padding
/// is zero.
Result<std::vector<Section>> DecodeFooter(std::span<const std::byte> file);

}  // namespace glint::archive_format
