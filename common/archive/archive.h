#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/archive/slice_table.h"
#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/domain/bake_domain.h"
#include "common/scene/scene.h"

namespace glint {

/// One reflection's tables. Rows are bake vertices. A slice that is absent is the unoccluded BRDF in layer 0,
/// and nothing in the layers above.
struct LayerViews {
  std::vector<SliceTableView> specular;  ///< one per specular lobe of the BRDF; columns are grid directions
  SliceTableView diffuse;                ///< columns: 0 front side, 1 back side
};

/// What WriteArchive writes: views into serialised tables, the domain, and deterministic metadata.
struct ArchiveContent {
  const BakeDomain* domain = nullptr;
  std::vector<Camera> cameras;
  int grid_level = 3;
  std::vector<LayerViews> layers;
  std::vector<std::vector<std::span<const std::byte>>>
      layer_bytes;          ///< [layer][slot]: specular slots, then diffuse
  std::string report_json;  ///< deterministic part of the bake's report
  Digest archive_key;       ///< hash of everything that went into the archive
};

/// Writes the archive (format: docs/archive-format.md), published atomically, footer last.
Status WriteArchive(const std::filesystem::path& path, const ArchiveContent& content);

/// Bytes of one section, for `glint inspect`.
struct SectionInfo {
  std::string name;
  uint64_t offset = 0, stored_bytes = 0, raw_bytes = 0;
};

/// A memory-mapped archive. Tables are used in place; geometry and BRDFs are decoded at opening.
class Archive {
 public:
  /// Checks magic, version, footer, every section's checksum (`verify_checksums`) and all bounds.
  /// Errors: kBadInput naming file, section and remedy.
  static Result<Archive> Open(const std::filesystem::path& path, bool verify_checksums = true);
  static Result<Archive> FromMemory(std::span<const std::byte> bytes, const std::string& name);
  Archive(Archive&&) noexcept;
  Archive& operator=(Archive&&) noexcept;
  ~Archive();

  const BakeDomain& domain() const;
  int grid_level() const;
  const std::vector<LayerViews>& layers() const;
  const std::vector<Camera>& cameras() const;
  const std::string& report_json() const;
  const Digest& archive_key() const;
  const std::vector<SectionInfo>& sections() const;
  uint64_t file_bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  Archive();
};

/// Every checksum and every invariant: what Open checks, and that each stored entry decodes to a finite lobe
/// within its ranges, that rows and columns are consistent, and that tables agree with the domain.
/// @param threads  0: all cores
/// Errors: kBadInput for a file that cannot be read, is no archive, or one of another version; kMismatch for
/// an archive that is damaged.
Status VerifyArchive(const std::filesystem::path& path, int threads = 0);

}  // namespace glint
