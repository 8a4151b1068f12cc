#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/domain/bake_settings.h"

namespace glint {

// How long a task should take: long enough that publishing its chunk and telling others of it (some 10 ms)
// are nothing beside it, short enough that a round ends evenly and a kill costs little. Those of a cheap
// shard may be shorter.
inline constexpr double kShortestTaskSeconds = 2, kLongestTaskSeconds = 20;
/// Tasks of a round that takes long enough: so many keep a thousand workers busy.
inline constexpr double kWantedTasks = 8192;
/// A round has at least so many tasks, even if they are shorter, ...
inline constexpr double kFewestTasks = 48;
/// ... unless they would have fewer vertices than this in no time at all.
inline constexpr uint32_t kFewestVertices = 64;

/// What a block of vertices took in an earlier round, and the line that whoever computed it waits at.
struct MeasuredBlock {
  GatherBlock block;
  double seconds = 0;
  std::optional<uint32_t> home;
};

/// What is known of a round's vertices before it is cut into tasks.
struct VertexWork {
  float seconds = 0;             ///< that the vertex is thought to take, with all its directions
  std::optional<uint32_t> home;  ///< line of the worker that holds its hits
};

/// Each vertex's part of what its blocks took; of blocks beside each other, the last one's home.
std::vector<VertexWork> SpreadWork(std::span<const MeasuredBlock> blocks, uint32_t vertices);

/// Cuts each shard (common/queue/shard.h), and in it what different workers hold, into tasks that are thought
/// to take alike, ordered by first vertex, then first column. Which tasks a round has changes no result.
/// @param columns_per_task  at most; > 0
std::vector<GatherBlock> CutByCost(std::span<const VertexWork> work, uint32_t columns,
                                   uint32_t columns_per_task);

/// The same with so many vertices a task.
std::vector<GatherBlock> CutEvenly(uint32_t vertices, uint32_t vertices_per_task, uint32_t columns,
                                   uint32_t columns_per_task);

}  // namespace glint
