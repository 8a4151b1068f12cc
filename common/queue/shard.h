#pragma once

#include <cstdint>

namespace glint {

// A bake's messages wait in several lines, one for each shard of the surface: a run of vertices, the same in
// every layer. Workers take tasks where they hold the vertices' hits from the layer before, and elsewhere
// when nothing is left there (worker/shard_chooser.h).

/// Shards of a surface: more than there are workers, so that each has some to itself. 1 to kMaxShards.
uint32_t ShardsFor(uint32_t vertices);

/// The shard of a vertex of a surface with `vertices` vertices; vertex < vertices.
inline uint32_t ShardOf(uint32_t vertex, uint32_t vertices, uint32_t shards) {
  return static_cast<uint32_t>(uint64_t{vertex} * shards / vertices);
}

}  // namespace glint
