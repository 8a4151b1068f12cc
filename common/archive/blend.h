#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "common/archive/lobe_codec.h"
#include "common/archive/nested.h"
#include "common/base/frame.h"
#include "common/domain/bake_settings.h"
#include "common/domain/facet_rows.h"
#include "common/lobes/vmf.h"

namespace glint {

// What stands between stored slices: laurijssen2011 Eq. 7, as transfer.cpp has it. Rendering blends corners
// with it, and the bake what it compares a slice with before it leaves it out.

/// A BRDF lobe is read as up to this many when its slices have several or its corners are too far apart to be
/// averaged.
inline constexpr int kMaxGroups = 8;

/// Unit vector along v, or `fallback` where v vanishes.
inline glm::vec3 UnitOr(const glm::vec3& v, const glm::vec3& fallback) {
  const float length2 = glm::dot(v, v);
  return length2 > 1e-20f ? v / std::sqrt(length2) : fallback;
}

/// Direct lobes of corners as one. Weights add up to 1.
class DirectBlend {
 public:
  void Add(float weight, const DirectLobe& lobe) {
    const float visible = weight * lobe.fraction;
    fraction_ += visible;
    shift_ += visible * lobe.shift;
    kappa_ratio_ += visible * lobe.kappa_ratio;
    stored_ = true;
  }
  /// A corner that nothing blocks.
  void AddFree(float weight) {
    fraction_ += weight;
    kappa_ratio_ += weight;
  }
  /// That part of another blend: what its corners have in common.
  void AddPart(float part, const DirectBlend& other) {
    fraction_ += part * other.fraction_;
    shift_ += part * other.shift_;
    kappa_ratio_ += part * other.kappa_ratio_;
    stored_ = true;
  }
  float fraction() const { return fraction_; }
  DirectLobe Lobe() const {
    if (!stored_) return {};
    if (fraction_ <= 0) return {.fraction = 0};
    return {std::min(fraction_, 1.0f), shift_ / fraction_, kappa_ratio_ / fraction_};
  }

 private:
  float fraction_ = 0, kappa_ratio_ = 0;
  glm::vec3 shift_{0};
  bool stored_ = false;
};

/// Direct lobes of corners of which some have several. The corner with the most light in several lobes says
/// which there are; those of other such corners go with the nearest of these, and corners with one lobe, or
/// none, which nothing blocks, are dealt out to all of them in proportion. So light and first moment are
/// those of the corners, interpolated, whatever goes with what; and where corners of several lobes lose their
/// weight, the lobes become that of the others.
class SeveralBlend {
 public:
  void AddFree(float weight) { single_.AddFree(weight); }
  /// A corner's stored lobes.
  void Add(float weight, const DirectLobe* lobe, int count) {
    if (count == 1) {
      single_.Add(weight, lobe[0]);
      return;
    }
    Corner& corner = corner_[corners_++];
    corner.weight = weight;
    corner.light = 0;
    corner.count = count;
    for (int i = 0; i < count; ++i) {
      corner.lobe[i] = {lobe[i].fraction, lobe[i].kappa_ratio, lobe[i].shift};
      corner.light += weight * lobe[i].fraction;
    }
  }
  /// Calls emit(DirectLobe) for what the corners come to.
  template <class Visit>
  void Emit(const Visit& emit) const {
    if (corners_ == 0) {
      emit(single_.Lobe());
      return;
    }
    const Corner& guide =
        *std::max_element(corner_.begin(), corner_.begin() + corners_,
                          [](const Corner& a, const Corner& b) { return a.light < b.light; });
    std::array<DirectBlend, kMaxSliceLobes> blend;
    for (int c = 0; c < corners_; ++c)
      for (int i = 0; i < corner_[c].count; ++i) {
        const Stored& lobe = corner_[c].lobe[i];
        const int like = &corner_[c] == &guide ? i : Nearest(guide, lobe.shift);
        blend[like].Add(corner_[c].weight, {lobe.fraction, lobe.shift, lobe.kappa_ratio});
      }
    float total = 0;
    for (const DirectBlend& b : blend) total += b.fraction();
    for (int i = 0; i < guide.count; ++i) {
      const float part = total > 0 ? blend[i].fraction() / total : 1.0f / static_cast<float>(guide.count);
      blend[i].AddPart(part, single_);
      emit(blend[i].Lobe());
    }
  }

 private:
  static constexpr int kMaxCorners = kMaxPointRows * kMaxStandIns;
  struct Stored {  // a DirectLobe that is left as it is until it is set
    float fraction, kappa_ratio;
    glm::vec3 shift;
  };
  struct Corner {
    float weight, light;
    int count;
    std::array<Stored, kMaxSliceLobes> lobe;
  };

  static int Nearest(const Corner& guide, const glm::vec3& shift) {
    int nearest = 0;
    float least = INFINITY;
    for (int i = 0; i < guide.count; ++i) {
      const glm::vec3 d = guide.lobe[i].shift - shift;
      if (glm::dot(d, d) < least) least = glm::dot(d, d), nearest = i;
    }
    return nearest;
  }

  DirectBlend single_;
  std::array<Corner, kMaxCorners> corner_;
  int corners_ = 0;
};

/// Lobes of a look-up's corners, gathered into groups of like ones. A group has at most one lobe of each
/// corner: what was stored as two lobes is not one thing.
class CornerGroups {
 public:
  struct Lobe {
    glm::vec3 alpha;  ///< times the corner's weight
    float strength;   ///< of alpha
    glm::vec3 mu;
    float kappa;
  };

  /// @param corner  ascending from call to call, below kMaxCorners; the same for all lobes of one
  void Add(int corner, const Lobe& lobe) {
    if (lobe.strength <= 0) return;
    several_ = several_ || (count_ > 0 && corner_[count_ - 1] == corner);
    corner_[count_] = corner;
    lobe_[count_++] = lobe;
    AddTo(&total_, lobe);
  }
  /// Calls emit(lobe) for every group, the one with the strongest lobe first. What is faint, or more than
  /// kMaxGroups, comes as one broad lobe. Ends the collection.
  template <class Visit>
  void Emit(const Visit& emit) {
    if (total_.strength <= 0) return;
    // 1 - |mean of mu| is the corners' mean 1 - cos from their common direction: mostly they are alike, which
    // saves the comparing. Corners' rms angle is then at most 1 / sqrt(kappa).
    const float length = glm::length(total_.mu);
    const bool alike =
        (total_.strength - length) * total_.kappa <= kAlike * total_.strength * total_.strength;
    if (alike && length > 0 && !several_) {
      emit({total_.alpha, total_.strength, total_.mu / length, total_.kappa / total_.strength});
      return;
    }
    for (int group = 1; count_ > 0; ++group) {
      const int strongest = Strongest();
      if (group == kMaxGroups || lobe_[strongest].strength < kFaint * total_.strength) {
        emit(TakeRest());
      } else {
        emit(TakeLike(strongest));
      }
    }
  }

 private:
  /// Rows around a point, each with as many slices as a nested grid's triangle comes down to.
  static constexpr int kMaxCorners = kMaxPointRows * kMaxStandIns;
  static constexpr float kAlike = 0.5f;

  int Strongest() const {
    int strongest = 0;
    for (int i = 1; i < count_; ++i)
      if (lobe_[i].strength > lobe_[strongest].strength) strongest = i;
    return strongest;
  }

  /// Takes out a lobe, and of each other corner the nearest that is not far from it.
  Lobe TakeLike(int seed_index) {
    const Lobe seed = lobe_[seed_index];
    std::array<int, kMaxCorners> nearest;
    std::array<float, kMaxCorners> distance;
    const int corners = corner_[count_ - 1] + 1;
    std::fill_n(nearest.begin(), corners, -1);
    std::fill_n(distance.begin(), corners, kFar);
    for (int i = 0; i < count_; ++i) {
      const glm::vec3 d = lobe_[i].mu - seed.mu;
      const float scaled = glm::dot(d, d) * std::min(lobe_[i].kappa, seed.kappa);
      if (scaled <= distance[corner_[i]]) distance[corner_[i]] = scaled, nearest[corner_[i]] = i;
    }
    nearest[corner_[seed_index]] = seed_index;
    Lobe sum{glm::vec3(0), 0, glm::vec3(0), 0};
    int left = 0;
    for (int i = 0; i < count_; ++i) {
      if (nearest[corner_[i]] == i) {
        AddTo(&sum, lobe_[i]);
      } else {
        corner_[left] = corner_[i];
        lobe_[left++] = lobe_[i];
      }
    }
    count_ = left;
    return {sum.alpha, sum.strength, UnitOr(sum.mu, seed.mu), sum.kappa / sum.strength};
  }

  /// Takes all that are left as the lobe with their moments: they need not be alike.
  Lobe TakeRest() {
    Lobe sum{glm::vec3(0), 0, glm::vec3(0), 0};
    for (int i = 0; i < count_; ++i) AddTo(&sum, lobe_[i]);
    const float cosine = glm::length(sum.mu) / sum.strength;
    const float delta = 1 - cosine * (1 - DeltaFromKappa(sum.kappa / sum.strength));
    count_ = 0;
    return {sum.alpha, sum.strength, UnitOr(sum.mu, lobe_[0].mu),
            KappaFromDelta(std::clamp(delta, 0.0f, 1.0f))};
  }

  static void AddTo(Lobe* sum, const Lobe& lobe) {
    sum->alpha += lobe.alpha;
    sum->strength += lobe.strength;
    sum->mu += lobe.strength * lobe.mu;
    sum->kappa += lobe.strength * lobe.kappa;
  }

  /// Apart if the angle exceeds 2 / sqrt(kappa) of the broader lobe.
  static constexpr float kFar = 4;
  static constexpr float kFaint = 0.04f;  ///< of all corners' light

  std::array<Lobe, kMaxCorners * kMaxSliceLobes> lobe_;
  std::array<int, kMaxCorners * kMaxSliceLobes> corner_;
  int count_ = 0;
  bool several_ = false;                          ///< some corner has more than one lobe
  Lobe total_{glm::vec3(0), 0, glm::vec3(0), 0};  ///< sums over all lobes; mu and kappa times strength
};

}  // namespace glint
