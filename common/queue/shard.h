#pragma once

#include <cstddef>
#include <cstdint>

namespace glint {

// A bake's messages wait in several lines, one for each shard of the surface: a run of vertices, the same in
// every layer. Workers take tasks where they hold the vertices' hits from the layer before, and elsewhere
// when nothing is left there (worker/shard_chooser.h).

/// Shards of a bake whose rounds have so many tasks: enough that each of many workers finds some of its own,
/// few enough that each has several tasks. 1 to kMaxShards.
uint32_t ShardsFor(size_t tasks);

/// The shard of a vertex of a surface with `vertices` vertices; vertex < vertices.
inline uint32_t ShardOf(uint32_t vertex, uint32_t vertices, uint32_t shards) {
  return static_cast<uint32_t>(uint64_t{vertex} * shards / vertices);
}

}  // namespace glint
