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
  const auto rank = [](const Shard& s) { return std::tuple(s.waiting > 0, s.kept, s.waiting, s.order); };
  const auto best = std::max_element(shards_.begin(), shards_.end(),
                                     [&](const Shard& a, const Shard& b) { return rank(a) < rank(b); });
  return {static_cast<uint32_t>(best - shards_.begin()), best->waiting > 0};
}

void ShardChooser::Update(std::span<const uint64_t> waiting) {
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < shards_.size(); ++i) shards_[i].waiting = i < waiting.size() ? waiting[i] : 0;
}

void ShardChooser::Took(const TaskMessage& task) {
  const std::lock_guard lock(mutex_);
  if (round_ != task.manifest) Forget();
  round_ = task.manifest;
  if (shards_[task.shard].waiting > 0) --shards_[task.shard].waiting;
}

void ShardChooser::FoundEmpty() {
  const std::lock_guard lock(mutex_);
  Forget();
}

void ShardChooser::Forget() {
  for (Shard& shard : shards_) shard.waiting = 0;
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
