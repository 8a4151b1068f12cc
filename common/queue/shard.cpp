#include "common/queue/shard.h"

#include <algorithm>
#include <bit>

#include "common/queue/task_queue.h"

namespace glint {

uint32_t ShardsFor(size_t tasks) {
  constexpr size_t kTasksPerShard = 4;
  const size_t shards = std::bit_floor(std::max<size_t>(tasks / kTasksPerShard, 1));
  return static_cast<uint32_t>(std::min<size_t>(shards, kMaxShards));
}

}  // namespace glint
