#pragma once

// Weighted sums over a vertex's hemisphere samples: the innermost loops of the bake. Plain arrays and no
// other includes: this is compiled once per instruction set, and nothing inline from elsewhere may leak out
// of those builds.

#include <cstdint>

namespace glint {

inline constexpr int kLanes = 8;

/// Samples of one hemisphere, in tiles of neighbouring directions. Arrays are padded to whole groups of
/// kLanes samples per tile; padding has solid angle 0. Directions are in the vertex's lattice frame.
struct SampleArrays {
  const float* x;
  const float* y;
  const float* z;
  const float* solid_angle;  ///< sr; 0 for padding and invalid samples
  const float* blocked;      ///< part of the sample that meets a surface, in [0, 1]
  /// alpha r, g, b and first moment x, y, z that the surface sends back, times the blocked solid angle
  const float* light[6];
  const uint32_t* tile_begin;   ///< tiles + 1 offsets, multiples of kLanes
  const uint8_t* tile_blocked;  ///< 1 if any sample of the tile is blocked
};

/// Bounding cones of tiles, padded to a multiple of kLanes with cones that nothing meets (cos_radius = -4).
struct TileCones {
  const float* x;
  const float* y;
  const float* z;
  const float* cos_radius;
  const float* sin_radius;
  int padded_count;
};

/// Tiles' cones, and a cone around each kLanes of them in a row.
struct ConeTree {
  TileCones tiles, groups;
};

/// A cone around (x, y, z).
struct QueryCone {
  float x, y, z, cos_radius, sin_radius;
};

/// exp(kappa (mu . s - 1)) as a weight; kappa_log2e = kappa * log2(e).
struct LobeWeight {
  float x, y, z, kappa_log2e;
};

struct DirectSums {
  float all = 0, all_x = 0, all_y = 0, all_z = 0;  ///< over all samples: weight, weight * direction
  float blocked = 0, blocked_x = 0, blocked_y = 0, blocked_z = 0;  ///< over blocked samples
};

struct IndirectSums {
  float light[6] = {};
};

/// What a slice's samples bring, each times its weight: a list to be grouped, in whole groups of kLanes whose
/// unused places hold zeros.
struct LightList {
  static constexpr int kChannels = 7;
  float* channel[kChannels];  ///< strength; its first moment x, y, z; colour r, g, b
  int count;
};

/// Sums of a list over the samples of one group.
struct LightSums {
  float strength = 0, moment[3] = {}, colour[3] = {};
};

inline constexpr int kMaxLightGroups = 4;

/// A lobe that samples are shared with in proportion to factor * weight.
struct SharingLobe {
  LobeWeight weight;
  float factor;
};

/// The loops for one instruction set. Every level adds in the same order; they differ in fused multiply-adds
/// only.
struct GatherKernels {
  const char* level;
  /// Writes the indices of tiles whose cone meets the query's; returns how many.
  int (*select_tiles)(const ConeTree& cones, const QueryCone& query, uint16_t* out);
  /// Whether any cone meets the query's.
  bool (*any_tile)(const ConeTree& cones, const QueryCone& query);
  void (*direct_lobe)(const SampleArrays& s, const uint16_t* tiles, int count, const LobeWeight& w,
                      DirectSums* out);
  void (*indirect_lobe)(const SampleArrays& s, const uint16_t* tiles, int count, const LobeWeight& w,
                        IndirectSums* out);
  /// The same with the cosine (z) as weight.
  void (*direct_cosine)(const SampleArrays& s, const uint16_t* tiles, int count, DirectSums* out);
  void (*indirect_cosine)(const SampleArrays& s, const uint16_t* tiles, int count, IndirectSums* out);
  /// Lists the light of the samples that send some, weighted as above. The list has room for all samples.
  void (*list_lobe)(const SampleArrays& s, const uint16_t* tiles, int count, const LobeWeight& w,
                    LightList* out);
  void (*list_cosine)(const SampleArrays& s, const uint16_t* tiles, int count, LightList* out);
  /// Lists what is not blocked, as white light, without its colour channels. The list has room for all
  /// samples.
  void (*list_visible_lobe)(const SampleArrays& s, const uint16_t* tiles, int count, const LobeWeight& w,
                            LightList* out);
  void (*list_visible_cosine)(const SampleArrays& s, const uint16_t* tiles, int count, LightList* out);
  /// Sum of strength * d d^T over a list, d = moment / strength - mean: xx, xy, xz, yy, yz, zz.
  void (*spread)(const LightList& list, const float mean[3], float out[6]);
  /// Sums the samples by the nearest of kMaxLightGroups centres, the first of equals.
  void (*group)(const LightList& list, const float centres[kMaxLightGroups][3], bool colour,
                LightSums out[kMaxLightGroups]);
  /// Shares each sample of unit directions among `lobes` lobes, and sums the shares, without colours. What
  /// lies far beyond all of them is lost.
  void (*share)(const LightList& list, const SharingLobe* lobe, int lobes, LightSums out[kMaxLightGroups]);
  /// Sum over the same samples and lobes of strength * factor * weight.
  float (*overlap)(const LightList& list, const SharingLobe* lobe, int lobes);
};

extern const GatherKernels kGatherKernelsBase;
extern const GatherKernels kGatherKernelsAvx2;

/// The best level that this processor runs.
const GatherKernels& SelectGatherKernels();

}  // namespace glint
