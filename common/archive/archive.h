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
#include "common/domain/direction_grid.h"
#include "common/scene/scene.h"

namespace glint {

/// Tables with one lobe of each slice. Rows are bake vertices.
struct LobeTables {
  std::vector<SliceTableView> specular;  ///< one per specular lobe of the BRDF; columns are grid directions
  SliceTableView diffuse;                ///< columns: 0 front side, 1 back side
};

/// One reflection's tables: the first lobe of every slice, which is its strongest. A slice that is absent
/// there is the unoccluded BRDF in layer 0, and nothing in the layers above. What a slice stands for is the
/// sum of its lobes.
struct LayerViews : LobeTables {
  /// Second, third, ... lobes of the slices that have them; nothing has an n-th lobe but what has those
  /// before.
  std::vector<LobeTables> further;
  /// Slices of directions beyond the grid's base level are predicted where they are absent (nested.h).
  bool nested = false;

  uint32_t lobes() const { return static_cast<uint32_t>(further.size()) + 1; }
  uint32_t diffuse_slot() const { return static_cast<uint32_t>(specular.size()); }
  /// Table of lobe `lobe` < lobes() and a specular slot or the diffuse one.
  const SliceTableView& table(uint32_t lobe, uint32_t slot) const {
    const LobeTables& tables = lobe == 0 ? *this : further[lobe - 1];
    return slot < specular.size() ? tables.specular[slot] : tables.diffuse;
  }
  /// Appends the next table of lobe 0, 1, ...: specular ones, then diffuse.
  void Add(uint32_t lobe, bool is_diffuse, const SliceTableView& table) {
    if (lobe > further.size()) further.emplace_back();
    LobeTables& tables = lobe == 0 ? *this : further[lobe - 1];
    if (is_diffuse) {
      tables.diffuse = table;
    } else {
      tables.specular.push_back(table);
    }
  }
};

/// What WriteArchive writes: views into serialised tables, the domain, and deterministic metadata.
struct ArchiveContent {
  const BakeDomain* domain = nullptr;
  std::vector<Camera> cameras;
  int grid_level = 3;
  /// DirectionGrid's; below grid_level: specular slices beyond it are predicted where they are absent
  int base_level = DirectionGrid::kMaxLevel;
  int slice_lobes = 1;  ///< lobes that a slice can have, 1 .. kMaxSliceLobes
  std::vector<LayerViews> layers;
  std::vector<std::vector<std::span<const std::byte>>>
      layer_bytes;          ///< [layer][slot]: specular slots, then diffuse; then the same of further lobes
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
  enum class Checks {
    kEverything,
    kAllButTables,  ///< reads of tables no more than what look-ups rely on (row_sums.h)
    kNothing,
  };
  /// Checks magic, version, footer, all bounds, and the sections' checksums. Errors: kBadInput naming file,
  /// section and remedy.
  static Result<Archive> Open(const std::filesystem::path& path, Checks checksums = Checks::kEverything);
  static Result<Archive> FromMemory(std::span<const std::byte> bytes, const std::string& name);
  Archive(Archive&&) noexcept;
  Archive& operator=(Archive&&) noexcept;
  ~Archive();

  const BakeDomain& domain() const;
  int grid_level() const;
  DirectionGrid MakeGrid() const;
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
