#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/round/task.h"

namespace glint {

/// All that a round's tasks are made from, by name: with the input file that InputKey() names, a process that
/// knows nothing else can compute any of them. Keys are not stored but follow from the rest, so that a
/// manifest cannot claim a result for inputs that it does not have.
struct RoundManifest {
  std::string execution;  ///< ExecutionId() that computes it
  Digest scene;           ///< Scene::content
  BakeSettings settings;
  int layer = 0;
  Digest previous;                  ///< digest of the layer before; zero in layer 0
  std::vector<GatherBlock> blocks;  ///< of task 0, 1, ...
  /// TaskSpec::home of task 0, 1, ...; in plans, else empty.
  std::vector<std::optional<uint32_t>> homes;

  Digest Bake() const { return BakeKey(execution, scene, settings); }
  /// @param index  < blocks.size()
  TaskSpec Task(size_t index) const;
  /// Name of the round's input: the surface, and the tables of the layer before.
  Digest InputKey() const;
};

/// Tasks of a round; bounds what a manifest can ask for.
inline constexpr size_t kMaxRoundTasks = 4'000'000;

/// JSON; the same manifest gives the same bytes. Fields: docs/service.md.
std::string ToJson(const RoundManifest& manifest);
/// Checks every field and bound, but for the vertices of the blocks, whose number the input tells. kBadInput
/// naming the field; kLimit.
Result<RoundManifest> ParseRoundManifest(std::span<const std::byte> json);

}  // namespace glint
