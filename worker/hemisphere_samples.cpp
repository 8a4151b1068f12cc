#include "worker/hemisphere_samples.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace glint {
namespace {

/// Neighbouring cells are looked at again if what they send differs by more: part of a white mirror's light.
constexpr float kUnlikeLight = 0.2f;
constexpr int kLooksAgain = 2;

bool Unlike(const HitLight& a, const HitLight& b) {
  const glm::vec3 moment = a.moment - b.moment;
  return std::abs(Luminance(a.alpha) - Luminance(b.alpha)) > kUnlikeLight ||
         glm::dot(moment, moment) > kUnlikeLight * kUnlikeLight;
}

}  // namespace

inline void HemisphereSamples::AddSample(const glm::vec3& direction, float solid_angle, uint8_t outcome,
                                         int cell) {
  if (outcome == HitSet::kInvalid) return;
  float blocked = outcome == HitSet::kHit ? 1.0f : 0.0f;
  if (outcome >= HitSet::kPartial) {
    const int leaving = ((outcome - HitSet::kPartial) & 3) + 1;
    blocked = static_cast<float>((outcome - HitSet::kPartial) >> 2) / static_cast<float>(leaving);
    solid_angle *= 0.25f * static_cast<float>(leaving);
  }
  if (blocked > 0) {
    hit_sample_.push_back(count_);
    hit_cell_.push_back(cell);
  }
  x_[count_] = direction.x;
  y_[count_] = direction.y;
  z_[count_] = direction.z;
  solid_angle_[count_] = solid_angle;
  blocked_[count_] = blocked;
  ++count_;
}

inline void HemisphereSamples::AddQuarter(const HemisphereLattice& lattice, int quarter, uint8_t outcome) {
  const glm::vec3& direction = lattice.direction(1, quarter);
  if (outcome < HitSet::kPair) {
    AddSample(direction, lattice.solid_angle(1), outcome, -1);
    return;
  }
  const int pair = outcome - HitSet::kPair;
  const glm::vec3 sum = direction + lattice.direction(1, quarter + (pair & 2 ? 2 : 1));
  AddSample(sum / glm::length(sum), 2 * lattice.solid_angle(1), pair & 1 ? HitSet::kHit : HitSet::kFree, -1);
}

void HemisphereSamples::Activate(int tile, const HemisphereLattice& lattice) {
  active_.Add(lattice.tile_cone(tile));
  active_tiles_.push_back(static_cast<uint16_t>(tile));
}

void HemisphereSamples::Expand(const HitSet& hits, const HemisphereLattice& lattice) {
  const size_t room = hits.outcome.size() + static_cast<size_t>(lattice.tiles()) * kLanes;
  for (auto* a : {&x_, &y_, &z_, &solid_angle_, &blocked_})
    if (a->size() < room) a->resize(room);
  count_ = 0;
  for (auto* a : {&tile_begin_, &hit_sample_, &tile_hit_}) a->clear();
  hit_cell_.clear();
  tile_blocked_.clear();
  active_.Clear();
  active_tiles_.clear();
  const uint8_t* outcome = hits.outcome.data();
  const uint8_t* quarter = outcome + hits.cells;
  for (int tile = 0; tile < lattice.tiles(); ++tile) {
    tile_begin_.push_back(count_);
    tile_hit_.push_back(static_cast<uint32_t>(hit_sample_.size()));
    const int first_cell = tile * HemisphereLattice::kTileCells;
    for (int c = first_cell; c < first_cell + HemisphereLattice::kTileCells; ++c) {
      if (outcome[c] == HitSet::kSplit) {
        for (int q = 0; q < 4; ++q) AddQuarter(lattice, 4 * c + q, *quarter++);
      } else {
        AddSample(lattice.direction(0, c), lattice.solid_angle(0), outcome[c], c);
      }
    }
    for (; count_ % kLanes != 0; ++count_) {
      x_[count_] = y_[count_] = solid_angle_[count_] = blocked_[count_] = 0;
      z_[count_] = 1;
    }
    tile_blocked_.push_back(hit_sample_.size() > tile_hit_.back());
    if (tile_blocked_.back()) Activate(tile, lattice);
  }
  tile_begin_.push_back(count_);
  tile_hit_.push_back(static_cast<uint32_t>(hit_sample_.size()));
  active_.Finish();
}

uint64_t HemisphereSamples::Shade(const HitSet& hits, const LatticePose& pose, const RayScene& rays,
                                  const LayerLight& light, float dark) {
  const size_t count = hits.hits.size();
  queries_.resize(count);
  hit_light_.resize(count);
  for (size_t h = 0; h < count; ++h) {
    const SurfaceHit& hit = hits.hits[h];
    const uint32_t i = hit_sample_[h];
    queries_[h] = {hit.triangle, static_cast<float>(hit.u) * (1 / 65535.0f),
                   static_cast<float>(hit.v) * (1 / 65535.0f), -pose.frame.ToWorld({x_[i], y_[i], z_[i]})};
  }
  light.Look(queries_, hit_light_.data());
  FindUnlikeCells(pose.lattice);
  LookAgain(pose, rays, light);
  for (auto& channel : light_)
    if (channel.size() < count_) channel.resize(count_);
  active_.Clear();
  active_tiles_.clear();
  for (int tile = 0; tile < pose.lattice.tiles(); ++tile)
    if (tile_blocked_[tile] && SetLight(tile, dark)) Activate(tile, pose.lattice);
  active_.Finish();
  return rays_.size();
}

void HemisphereSamples::FindUnlikeCells(const HemisphereLattice& lattice) {
  const int stride = lattice.side() + 1;  // the column on the right and the row above are the border
  cell_hit_.assign(static_cast<size_t>(stride) * stride, -1);
  auto at = [&](int cell) {
    const auto& [x, y] = lattice.place(0, cell);
    return static_cast<size_t>(y) * stride + x;
  };
  unlike_.assign(hit_cell_.size(), 0);
  for (size_t h = 0; h < hit_cell_.size(); ++h)
    if (hit_cell_[h] >= 0) cell_hit_[at(hit_cell_[h])] = static_cast<int32_t>(h);
  for (size_t h = 0; h < hit_cell_.size(); ++h) {
    if (hit_cell_[h] < 0) continue;
    const int32_t* mine = &cell_hit_[at(hit_cell_[h])];
    for (const int32_t other : {mine[1], mine[stride]})
      if (other >= 0 && Unlike(hit_light_[h], hit_light_[other])) unlike_[h] = unlike_[other] = 1;
  }
}

/// The cells keep their weight; only their light is averaged, over the ray that they have and one through
/// each of two quarters across from each other. Hence what a slice's weights add up to stays the same in
/// every layer. All four quarters bring no smaller an error: which two of them it is changes from cell to
/// cell.
void HemisphereSamples::LookAgain(const LatticePose& pose, const RayScene& rays, const LayerLight& light) {
  rays_.clear();
  for (size_t h = 0; h < unlike_.size(); ++h) {
    if (!unlike_[h]) continue;
    const int quarter = static_cast<int>(h % 2);
    for (const int q : {quarter, 3 - quarter}) {
      Ray& ray = rays_.emplace_back();
      ray.origin = pose.origin;
      ray.direction = pose.frame.ToWorld(pose.lattice.direction(1, 4 * hit_cell_[h] + q));
    }
  }
  found_.resize(rays_.size());
  rays.Intersect(rays_.data(), found_.data(), static_cast<int>(rays_.size()));
  queries_.clear();
  for (size_t i = 0; i < rays_.size(); ++i)
    if (found_[i].hit())
      queries_.push_back({found_[i].triangle, found_[i].u, found_[i].v, -rays_[i].direction});
  answers_.resize(queries_.size());
  light.Look(queries_, answers_.data());
  const Hit* found = found_.data();
  const HitLight* answer = answers_.data();
  for (size_t h = 0; h < unlike_.size(); ++h) {
    if (!unlike_[h]) continue;
    HitLight sum = hit_light_[h];
    for (int ray = 0; ray < kLooksAgain; ++ray) {
      if (!found++->hit()) continue;
      sum.alpha += answer->alpha;
      sum.moment += answer->moment;
      ++answer;
    }
    constexpr float kShare = 1.0f / (1 + kLooksAgain);
    hit_light_[h] = {kShare * sum.alpha, kShare * sum.moment};
  }
}

/// Fills a tile's channels; false, and the channels as they were, if its light is dark.
bool HemisphereSamples::SetLight(int tile, float dark) {
  float brightest = 0;
  for (uint32_t h = tile_hit_[tile]; h < tile_hit_[tile + 1]; ++h) {
    const glm::vec3& alpha = hit_light_[h].alpha;
    brightest = std::max(brightest, std::max(std::max(alpha.x, alpha.y), alpha.z));
  }
  if (!(brightest > dark)) return false;
  for (auto& channel : light_)
    std::fill(channel.begin() + tile_begin_[tile], channel.begin() + tile_begin_[tile + 1], 0.0f);
  for (uint32_t h = tile_hit_[tile]; h < tile_hit_[tile + 1]; ++h) {
    const uint32_t i = hit_sample_[h];
    const float share = blocked_[i] * solid_angle_[i];
    for (int c = 0; c < 3; ++c) {
      light_[c][i] = share * hit_light_[h].alpha[c];
      light_[3 + c][i] = share * hit_light_[h].moment[c];
    }
  }
  return true;
}

SampleArrays HemisphereSamples::arrays() const {
  return {x_.data(),
          y_.data(),
          z_.data(),
          solid_angle_.data(),
          blocked_.data(),
          {light_[0].data(), light_[1].data(), light_[2].data(), light_[3].data(), light_[4].data(),
           light_[5].data()},
          tile_begin_.data(),
          tile_blocked_.data()};
}

}  // namespace glint
