#include "worker/shard_chooser.h"

#include <algorithm>
#include <tuple>

#include "common/queue/shard.h"

namespace glint {

size_t ChooseBake(std::span<const QueuedBake> bakes, std::mt19937* random) {
  std::vector<double> weights;
  for (const QueuedBake& bake : bakes) weights.push_back(bake.priority);
  return std::discrete_distribution<size_t>(weights.begin(), weights.end())(*random);
}

ShardChooser::ShardChooser(uint32_t shards, uint64_t seed) : shards_(shards) {
  std::mt19937_64 random(seed);
  for (Shard& shard : shards_) shard.order = random();
}

ShardChooser::Choice ShardChooser::Choose() const {
  const std::lock_guard lock(mutex_);
  const auto rank = [](const Shard& s) {
    return std::tuple(s.Waiting() > 0, s.messages > 0, s.kept, s.Waiting(), s.order);
  };
  const auto best = std::max_element(shards_.begin(), shards_.end(),
                                     [&](const Shard& a, const Shard& b) { return rank(a) < rank(b); });
  return {static_cast<uint32_t>(best - shards_.begin()), best->Waiting() > 0};
}

void ShardChooser::Update(std::span<const uint64_t> messages) {
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < shards_.size(); ++i) {
    shards_[i].messages = i < messages.size() ? messages[i] : 0;
    shards_[i].taken = std::min(shards_[i].taken, shards_[i].messages);
  }
}

void ShardChooser::Took(const TaskMessage& task) {
  const std::lock_guard lock(mutex_);
  Shard& shard = shards_[task.shard];
  if (round_ != task.manifest) {
    Forget();
    for (Shard& s : shards_) s.taken = 0;
  }
  round_ = task.manifest;
  if (shard.messages > 0) --shard.messages;
}

void ShardChooser::FoundEmpty(uint32_t shard) {
  const std::lock_guard lock(mutex_);
  const uint64_t taken = shards_[shard].messages;
  Forget();
  shards_[shard].taken = taken;
}

void ShardChooser::Forget() {
  for (Shard& shard : shards_) shard.messages = 0;
}

void ShardChooser::Keep(const GatherBlock& block, uint32_t vertices) {
  const std::lock_guard lock(mutex_);
  kept_.resize(std::max<size_t>(kept_.size(), vertices));
  for (uint32_t v = block.first_vertex; v < block.first_vertex + block.vertices; ++v) {
    if (kept_[v]) continue;
    kept_[v] = true;
    ++shards_[ShardOf(v, vertices, static_cast<uint32_t>(shards_.size()))].kept;
  }
}

}  // namespace glint
