#pragma once

#include <cstdint>
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

/// What a block of vertices took in an earlier round.
struct MeasuredBlock {
  GatherBlock block;
  double seconds = 0;
};

/// Each vertex's part of what its blocks took.
std::vector<float> SpreadSeconds(std::span<const MeasuredBlock> blocks, uint32_t vertices);

/// Cuts each shard (common/queue/shard.h) into tasks that are thought to take alike, ordered by first vertex,
/// then first column: whoever has computed a shard finds the whole of its next tasks in memory. Which tasks a
/// round has changes no result.
/// @param seconds           that each vertex is thought to take, with all its directions
/// @param columns_per_task  at most; > 0
std::vector<GatherBlock> CutByCost(std::span<const float> seconds, uint32_t columns,
                                   uint32_t columns_per_task);

/// The same with so many vertices a task.
std::vector<GatherBlock> CutEvenly(uint32_t vertices, uint32_t vertices_per_task, uint32_t columns,
                                   uint32_t columns_per_task);

}  // namespace glint
