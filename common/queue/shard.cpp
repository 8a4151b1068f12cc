#include "common/queue/shard.h"

#include <algorithm>
#include <bit>

#include "common/queue/task_queue.h"

namespace glint {

uint32_t ShardsFor(uint32_t vertices) {
  constexpr uint32_t kVerticesPerShard = 512;
  return std::min(std::bit_floor(std::max(vertices / kVerticesPerShard, 1u)), kMaxShards);
}

}  // namespace glint
