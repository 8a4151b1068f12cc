#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <shared_mutex>

#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/round/manifest.h"
#include "common/store/store.h"
#include "worker/worker_meter.h"

namespace glint {

/// Runs tasks of one bake from its folder, which is all that it knows of the bake. Keeps what the next task
/// can use: the tree over the triangles and the hit sets, and of one round the layer before.
class BakeRunner {
 public:
  /// @param folder        of the bake, with its chunks
  /// @param threads       to turn to a round with; Run may be called by any number
  /// @param memory_bytes  bound on hit sets kept between rounds
  /// @param meter         null: nobody watches
  /// @param home          noted of what it computes (TaskNote)
  static Result<BakeRunner> Open(const std::filesystem::path& folder, int threads, uint64_t memory_bytes,
                                 WorkerMeter* meter = nullptr, std::optional<uint32_t> home = std::nullopt);
  BakeRunner(BakeRunner&&) noexcept;
  ~BakeRunner();

  /// Computes task `index` of a round of this bake and publishes its chunk; true: it was there. Thread-safe;
  /// tasks of another round than the one at hand wait until those at work are done. kUsage: no such task;
  /// kMismatch: this program cannot compute the bake's tasks; kBadInput, kLimit: the round's input is
  /// missing, damaged or too large; kIo.
  Result<bool> Run(const RoundManifest& round, size_t index);

 private:
  struct Surface;
  struct State;
  explicit BakeRunner(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

/// kMismatch, naming both, unless this program computes what the round asks for.
Status CheckExecution(const RoundManifest& round);

}  // namespace glint
