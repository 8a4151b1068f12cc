#include "worker/bake_runner.h"

#include <mutex>
#include <string>
#include <utility>

#include "common/archive/archive.h"
#include "common/archive/row_sums.h"
#include "common/round/round_files.h"
#include "worker/compute_task.h"
#include "worker/execution_id.h"
#include "worker/gather.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

/// What a round reads: of the layer before only the rows that its rays reach.
struct RoundInput {
  Archive archive;
  std::vector<uint64_t> row_sums;

  const LayerViews* Previous() const { return archive.layers().empty() ? nullptr : &archive.layers().back(); }
};

/// The round's input, if it is what the manifest names.
Result<RoundInput> OpenInput(const fs::path& folder, const RoundManifest& round) {
  const fs::path path = InputPath(folder, round.InputKey());
  GLINT_ASSIGN_OR_RETURN(Archive archive, Archive::Open(path, Archive::Checks::kAllButTables));
  const bool matches = archive.archive_key() == round.InputKey() &&
                       archive.grid_level() == round.settings.grid_level &&
                       archive.layers().empty() == (round.layer == 0);
  if (!matches)
    return BadInput(path.string() + ": is not the input of this round; remove the file and resume the bake");
  RoundInput input{std::move(archive), {}};
  if (round.layer > 0) {
    GLINT_ASSIGN_OR_RETURN(input.row_sums, ReadRowSums(InputRowsPath(folder, round.InputKey()),
                                                       input.archive.domain().row_count()));
  }
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
  std::optional<uint32_t> home;
  std::shared_mutex mutex;            ///< shared: tasks at work; exclusive: the round changes
  std::unique_ptr<Surface> surface;   ///< of the first task that had to be computed
  std::optional<Digest> round_input;  ///< that the gatherer has turned to
  std::optional<RoundInput> input;    ///< which it reads as it goes

  Status BeginRound(const RoundManifest& round) {
    const MeteredSpan span(meter ? &meter->round_seconds : nullptr);
    GLINT_ASSIGN_OR_RETURN(RoundInput opened, OpenInput(store.root(), round));
    round_input.reset();  // should something fail half way
    if (surface && surface->bake == round.Bake() &&
        surface->domain.row_count() != opened.archive.domain().row_count())
      return BadInput(InputPath(store.root(), round.InputKey()).string() + ": is of another surface");
    if (!surface || surface->bake != round.Bake()) {
      surface.reset();
      auto made =
          std::make_unique<Surface>(round.Bake(), opened.archive.domain(), round.settings, memory_bytes);
      GLINT_RETURN_IF_ERROR(made->rays.status());
      surface = std::move(made);
    }
    surface->gatherer->BeginLayer(round.layer, opened.Previous(), threads, opened.row_sums);
    input.emplace(std::move(opened));  // and that of the round before goes
    round_input = round.InputKey();
    return {};
  }

  void ForgetRound(const RoundManifest& round) {
    const std::unique_lock changing(mutex);
    if (round_input == round.InputKey()) round_input.reset();
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
                                    WorkerMeter* meter, std::optional<uint32_t> home) {
  GLINT_ASSIGN_OR_RETURN(ChunkStore store, ChunkStore::Open(folder));
  return BakeRunner(std::unique_ptr<State>(
      new State{std::move(store), threads, memory_bytes, meter, home, {}, {}, {}, {}}));
}

Result<bool> BakeRunner::Run(const RoundManifest& round, size_t index) {
  GLINT_RETURN_IF_ERROR(CheckExecution(round));
  if (index >= round.blocks.size()) {
    return UsageError("task " + std::to_string(index) + ": the round has tasks 0 to " +
                      std::to_string(round.blocks.size() - 1));
  }
  const TaskSpec task = round.Task(index);
  if (state_->store.FindResult(task.key)) return true;
  GLINT_ASSIGN_OR_RETURN(std::shared_lock<std::shared_mutex> at_work, state_->EnterRound(round));
  GLINT_RETURN_IF_ERROR(CheckBlock(task.block, state_->surface->domain));
  const Status computed =
      ComputeTask(task, *state_->surface->gatherer, &state_->store, state_->meter, state_->home);
  if (computed.kind() == ErrorKind::kBadInput) {
    at_work.unlock();
    state_->ForgetRound(round);  // its input may be written anew, under the same name
    return computed.WithContext(InputPath(state_->store.root(), round.InputKey()).string() +
                                " (remove it and resume the bake)");
  }
  GLINT_RETURN_IF_ERROR(computed);
  return false;
}

Status CheckExecution(const RoundManifest& round) {
  static const std::string own = ExecutionId();
  if (round.execution == own) return {};
  return Mismatch("the bake's results are those of '" + round.execution + "'; this program, here, is '" +
                  own + "': use the same version on a machine of that kind");
}

}  // namespace glint
