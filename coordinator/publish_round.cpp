#include "coordinator/publish_round.h"

#include <cstddef>
#include <utility>

#include "common/archive/archive.h"
#include "common/archive/chunk.h"
#include "common/archive/lobe_codec.h"
#include "common/archive/row_sums.h"
#include "common/archive/slice_table.h"
#include "common/base/files.h"
#include "common/round/round_files.h"
#include "worker/execution_id.h"

namespace glint {
namespace {

RoundManifest MakeManifest(const ExecutorInput& bake, const Round& round) {
  RoundManifest manifest;
  manifest.execution = ExecutionId();
  manifest.scene = bake.scene;
  manifest.settings = bake.settings;
  manifest.layer = round.tasks.front().layer;
  if (round.previous) manifest.previous = round.previous->digest;
  for (const TaskSpec& task : round.tasks) manifest.blocks.push_back(task.block);
  return manifest;
}

/// Tables of a direct layer without entries. An archive's first layer is the direct one, which no round after
/// the next one reads.
std::vector<std::vector<std::byte>> EmptyDirectLayer(const ExecutorInput& bake) {
  const SlotLayout layout{static_cast<uint32_t>(bake.domain.max_lobes()), bake.settings.StoredLobes()};
  std::vector<std::vector<std::byte>> tables;
  for (uint32_t slot = 0; slot < layout.count(); ++slot) {
    const uint32_t columns = layout.is_diffuse(slot) ? 2 : bake.grid.size();
    tables.push_back(SliceTableBuilder(bake.domain.row_count(), columns, kDirectEntryBytes).Finish());
  }
  return tables;
}

/// An archive of the surface, and the layer before as its last layer.
Status WriteInput(const ExecutorInput& bake, const RoundManifest& manifest, const Layer* previous) {
  std::vector<std::vector<std::byte>> empty;
  ArchiveContent content;
  content.domain = &bake.domain;
  content.grid_level = bake.grid.level();
  content.base_level = bake.grid.base_level();
  content.slice_lobes = static_cast<int>(bake.settings.StoredLobes());
  content.archive_key = manifest.InputKey();
  if (manifest.layer > 1) {
    empty = EmptyDirectLayer(bake);
    content.layer_bytes.emplace_back(empty.begin(), empty.end());
  }
  if (previous) content.layer_bytes.emplace_back(previous->slots.begin(), previous->slots.end());
  const std::filesystem::path path = InputPath(bake.store.root(), manifest.InputKey());
  GLINT_RETURN_IF_ERROR(CreateFolders(path.parent_path()));
  if (previous) {
    const std::vector<uint64_t> sums = RowSums(previous->views, bake.domain.row_count(), bake.threads);
    GLINT_RETURN_IF_ERROR(WriteRowSums(InputRowsPath(bake.store.root(), manifest.InputKey()), sums));
  }
  return WriteArchive(path, content);
}

}  // namespace

Result<Digest> PublishRound(const ExecutorInput& bake, const Round& round) {
  const RoundManifest manifest = MakeManifest(bake, round);
  if (manifest.blocks.size() > kMaxRoundTasks) {
    return LimitExceeded(std::to_string(manifest.blocks.size()) + " tasks in a layer, more than " +
                         std::to_string(kMaxRoundTasks) + "; make them larger (--vertices-per-task)");
  }
  GLINT_RETURN_IF_ERROR(WriteInput(bake, manifest, round.previous));
  return WriteManifest(bake.store.root(), manifest);
}

std::vector<size_t> FindMissing(const ChunkStore& store, const Round& round) {
  std::vector<size_t> missing;
  for (size_t i = 0; i < round.tasks.size(); ++i) {
    if (!store.FindResult(round.tasks[i].key)) missing.push_back(i);
  }
  return missing;
}

}  // namespace glint
