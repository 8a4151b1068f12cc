#include "worker/bake_runner.h"

#include <mutex>
#include <string>
#include <utility>

#include "common/archive/archive.h"
#include "common/round/round_files.h"
#include "worker/compute_task.h"
#include "worker/execution_id.h"
#include "worker/gather.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

/// The round's input, if it is what the manifest names.
Result<Archive> OpenInput(const fs::path& folder, const RoundManifest& round) {
  const fs::path path = InputPath(folder, round.InputKey());
  GLINT_ASSIGN_OR_RETURN(Archive input, Archive::Open(path));
  const bool matches = input.archive_key() == round.InputKey() &&
                       input.grid_level() == round.settings.grid_level &&
                       input.layers().empty() == (round.layer == 0);
  if (!matches)
    return BadInput(path.string() + ": is not the input of this round; remove the file and resume the bake");
  return input;
}

Status CheckBlock(const GatherBlock& block, const BakeDomain& domain) {
  const uint64_t end = uint64_t{block.first_vertex} + block.vertices;
  if (end <= domain.row_count()) return {};
  return BadInput("the task's vertices end at " + std::to_string(end) + ", the surface has " +
                  std::to_string(domain.row_count()));
}

}  // namespace

/// What all rounds of a bake share.
struct BakeRunner::Surface {
  Surface(const Digest& bake_key, const BakeDomain& from, const BakeSettings& settings, uint64_t memory_bytes)
      : bake(bake_key),
        domain(from),
        grid(settings.grid_level, settings.BaseLevel()),
        rays(domain.positions, domain.triangles),
        gatherer(MakeGatherer({domain, rays, grid}, settings, memory_bytes)) {}

  const Digest bake;
  const BakeDomain domain;
  const DirectionGrid grid;
  const RayScene rays;
  const std::unique_ptr<Gatherer> gatherer;
};

struct BakeRunner::State {
  ChunkStore store;
  int threads;
  uint64_t memory_bytes;
  WorkerMeter* meter;
  std::shared_mutex mutex;            ///< shared: tasks at work; exclusive: the round changes
  std::unique_ptr<Surface> surface;   ///< of the first task that had to be computed
  std::optional<Digest> round_input;  ///< that the gatherer has turned to

  Status BeginRound(const RoundManifest& round) {
    const MeteredSpan span(meter ? &meter->round_seconds : nullptr);
    GLINT_ASSIGN_OR_RETURN(const Archive input, OpenInput(store.root(), round));
    round_input.reset();  // should something fail half way
    if (!surface || surface->bake != round.Bake()) {
      surface.reset();
      auto made = std::make_unique<Surface>(round.Bake(), input.domain(), round.settings, memory_bytes);
      GLINT_RETURN_IF_ERROR(made->rays.status());
      surface = std::move(made);
    }
    surface->gatherer->BeginLayer(round.layer, round.layer > 0 ? &input.layers().back() : nullptr, threads);
    round_input = round.InputKey();
    return {};
  }

  /// Returns holding the lock, with the gatherer at the round.
  Result<std::shared_lock<std::shared_mutex>> EnterRound(const RoundManifest& round) {
    const Digest wanted = round.InputKey();
    for (;;) {
      std::shared_lock at_work(mutex);
      if (round_input == wanted) return at_work;
      at_work.unlock();
      const std::unique_lock changing(mutex);
      if (round_input != wanted) GLINT_RETURN_IF_ERROR(BeginRound(round));
    }
  }
};

BakeRunner::BakeRunner(std::unique_ptr<State> state) : state_(std::move(state)) {}
BakeRunner::BakeRunner(BakeRunner&&) noexcept = default;
BakeRunner::~BakeRunner() = default;

Result<BakeRunner> BakeRunner::Open(const fs::path& folder, int threads, uint64_t memory_bytes,
                                    WorkerMeter* meter) {
  GLINT_ASSIGN_OR_RETURN(ChunkStore store, ChunkStore::Open(folder));
  return BakeRunner(
      std::unique_ptr<State>(new State{std::move(store), threads, memory_bytes, meter, {}, {}, {}}));
}

Result<bool> BakeRunner::Run(const RoundManifest& round, size_t index) {
  GLINT_RETURN_IF_ERROR(CheckExecution(round));
  if (index >= round.blocks.size()) {
    return UsageError("task " + std::to_string(index) + ": the round has tasks 0 to " +
                      std::to_string(round.blocks.size() - 1));
  }
  const TaskSpec task = round.Task(index);
  if (state_->store.FindResult(task.key)) return true;
  GLINT_ASSIGN_OR_RETURN(const std::shared_lock<std::shared_mutex> at_work, state_->EnterRound(round));
  GLINT_RETURN_IF_ERROR(CheckBlock(task.block, state_->surface->domain));
  GLINT_RETURN_IF_ERROR(ComputeTask(task, *state_->surface->gatherer, &state_->store, state_->meter));
  return false;
}

uint32_t BakeRunner::vertices() const {
  const std::shared_lock lock(state_->mutex);
  return state_->surface ? state_->surface->domain.row_count() : 0;
}

Status CheckExecution(const RoundManifest& round) {
  static const std::string own = ExecutionId();
  if (round.execution == own) return {};
  return Mismatch("the bake's results are those of '" + round.execution + "'; this program, here, is '" +
                  own + "': use the same version on a machine of that kind");
}

}  // namespace glint
