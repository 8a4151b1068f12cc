#include "coordinator/round_plan.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

#include "common/base/files.h"
#include "common/round/manifest.h"
#include "common/round/round_files.h"
#include "coordinator/partition.h"
#include "worker/execution_id.h"
#include "worker/vertex_cost.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

RoundManifest Describe(const PlanInput& input, int layer, const Digest& previous) {
  RoundManifest round;
  round.execution = ExecutionId();
  round.scene = input.scene;
  round.settings = input.settings;
  round.layer = layer;
  round.previous = previous;
  return round;
}

uint32_t ColumnsPerTask(const PlanInput& input) {
  const uint32_t columns = input.grid.size();
  return input.directions_per_task ? std::min(input.directions_per_task, columns) : columns;
}

std::vector<VertexWork> WorkAhead(const PlanInput& input, std::span<const TaskSpec> before) {
  const uint32_t vertices = input.domain.row_count();
  std::vector<MeasuredBlock> measured;
  double total = 0;
  for (const TaskSpec& task : before) {
    const TaskNote note = input.store.FindNote(task.key).value_or(TaskNote());
    measured.push_back({task.block, note.seconds, note.home});
    total += note.seconds;
  }
  if (total > 0) return SpreadWork(measured, vertices);
  std::vector<VertexWork> work;
  for (const float seconds : GuessVertexSeconds(input.domain, input.settings, input.grid.size()))
    work.push_back({seconds, std::nullopt});
  return work;
}

/// Whether the blocks are all of the round, in order, as CutByCost leaves them.
bool Covers(const std::vector<GatherBlock>& blocks, const PlanInput& input) {
  uint32_t first = 0, column = 0;
  for (const GatherBlock& block : blocks) {
    const bool follows = block.first_vertex == first && block.first_column == column &&
                         block.columns == std::min(ColumnsPerTask(input), input.grid.size() - column);
    if (!follows) return false;
    column += block.columns;
    if (column < input.grid.size()) continue;
    column = 0;
    first += block.vertices;
  }
  return column == 0 && first == input.domain.row_count();
}

/// None: there is no plan, or one that is damaged or for other words.
std::optional<RoundManifest> ReadPlan(const fs::path& path, const PlanInput& input,
                                      const RoundManifest& round) {
  Result<RoundManifest> plan = ReadManifest(path);
  const bool fits = plan.ok() && plan->InputKey() == round.InputKey() && Covers(plan->blocks, input);
  return fits ? std::optional(std::move(plan).value()) : std::nullopt;
}

Result<RoundManifest> KeptPlan(const PlanInput& input, RoundManifest round,
                               std::span<const TaskSpec> before) {
  const fs::path path = PlanPath(input.store.root(), round.InputKey());
  if (std::optional<RoundManifest> kept = ReadPlan(path, input, round)) return std::move(*kept);
  const std::vector<VertexWork> work = WorkAhead(input, before);
  round.blocks = CutByCost(work, input.grid.size(), ColumnsPerTask(input));
  for (const GatherBlock& block : round.blocks) round.homes.push_back(work[block.first_vertex].home);
  const std::string json = ToJson(round);
  GLINT_RETURN_IF_ERROR(CreateFolders(path.parent_path()));
  GLINT_RETURN_IF_ERROR(PublishFile(path, std::as_bytes(std::span(json))));
  return round;
}

}  // namespace

Result<std::vector<TaskSpec>> PlanRound(const PlanInput& input, int layer, const Digest& previous,
                                        std::span<const TaskSpec> before) {
  RoundManifest round = Describe(input, layer, previous);
  if (input.vertices_per_task > 0) {
    round.blocks = CutEvenly(input.domain.row_count(), input.vertices_per_task, input.grid.size(),
                             ColumnsPerTask(input));
  } else {
    GLINT_ASSIGN_OR_RETURN(round, KeptPlan(input, round, before));
  }
  std::vector<TaskSpec> tasks;
  for (size_t i = 0; i < round.blocks.size(); ++i) tasks.push_back(round.Task(i));
  return tasks;
}

}  // namespace glint
