#pragma once

#include <cstdint>

namespace glint {

// A bake's messages wait in several lines, as many as its surface has shards: runs of vertices, the same in
// every layer. In the first layer a task waits in its shard's line; in later ones where the worker waits that
// computed its vertices before, and so holds their hits (worker/line_chooser.h).

/// Shards of a surface: more than there are workers, so that each has some to itself. 1 to kMaxShards.
uint32_t ShardsFor(uint32_t vertices);

/// The shard of a vertex of a surface with `vertices` vertices; vertex < vertices.
inline uint32_t ShardOf(uint32_t vertex, uint32_t vertices, uint32_t shards) {
  return static_cast<uint32_t>(uint64_t{vertex} * shards / vertices);
}

}  // namespace glint
