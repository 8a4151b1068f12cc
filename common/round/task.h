#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/base/hash.h"
#include "common/domain/bake_settings.h"

namespace glint {

/// One task: a pure function of what its key hashes. Its result is a chunk in the store.
struct TaskSpec {
  Digest key;
  int layer = 0;
  GatherBlock block;
  /// Line (common/queue/shard.h) of the worker that holds its vertices' hits, if one does. Not in the key.
  std::optional<uint32_t> home = std::nullopt;
};

/// What every task of a bake depends on.
/// @param execution  program, instruction set, ...: ExecutionId() of those that compute it
/// @param scene      Scene::content
Digest BakeKey(const std::string& execution, const Digest& scene, const BakeSettings& settings);

/// @param previous  digest of the layer before; zero in layer 0
Digest TaskKey(const Digest& bake_key, int layer, const GatherBlock& block, const Digest& previous);

}  // namespace glint
