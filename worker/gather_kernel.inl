// Body of the gather kernels; included by one source file per instruction set, which defines GLINT_KERNELS (the name of
// the table) and GLINT_KERNEL_LEVEL.

#include "worker/gather_kernel.h"

namespace glint {
namespace {

typedef float Floats __attribute__((vector_size(4 * kLanes)));
typedef int32_t Ints __attribute__((vector_size(4 * kLanes)));

inline Floats Load(const float* p) {
  Floats v;
  __builtin_memcpy(&v, p, sizeof v);
  return v;
}

inline Floats Splat(float x) { return Floats{x, x, x, x, x, x, x, x}; }

inline float Sum(const Floats& v) { return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7])); }

/// 2^x for x <= 0, relative error 3e-7; what lies below 2^-126 gives about 2^-126. Round to the nearest integer with
/// the 1.5 * 2^23 trick, whose low bits then are that integer and go to the exponent.
inline Floats Exp2(Floats x) {
  x = x < -126.0f ? Splat(-126.0f) : x;
  const Floats shifted = x + 12582912.0f;
  const Floats f = x - (shifted - 12582912.0f);
  Floats p = Splat(1.3390863e-03f);
  p = p * f + 9.6760319e-03f;
  p = p * f + 5.5503571e-02f;
  p = p * f + 2.4022107e-01f;
  p = p * f + 6.9314719e-01f;
  p = p * f + 1.0000001e+00f;
  Ints bits, exponent;
  __builtin_memcpy(&bits, &p, sizeof bits);
  __builtin_memcpy(&exponent, &shifted, sizeof exponent);
  bits += exponent << 23;
  Floats result;
  __builtin_memcpy(&result, &bits, sizeof result);
  return result;
}

struct LobeWeigher {
  Floats x, y, z, k;
  explicit LobeWeigher(const LobeWeight& w) : x(Splat(w.x)), y(Splat(w.y)), z(Splat(w.z)), k(Splat(w.kappa_log2e)) {}
  Floats operator()(const Floats& sx, const Floats& sy, const Floats& sz) const {
    const Floats exponent = k * (x * sx + y * sy + z * sz - 1.0f);
    return Exp2(exponent > 0.0f ? Splat(0) : exponent);
  }
};

struct CosineWeigher {
  Floats operator()(const Floats&, const Floats&, const Floats& sz) const { return sz; }
};

struct DirectAccumulator {
  Floats sum[8] = {};
  template <class Weigher>
  void AddTile(const SampleArrays& s, uint32_t tile, const Weigher& weigher) {
    const bool blocked = s.tile_blocked[tile];
    for (uint32_t i = s.tile_begin[tile]; i < s.tile_begin[tile + 1]; i += kLanes) {
      const Floats x = Load(s.x + i), y = Load(s.y + i), z = Load(s.z + i);
      const Floats w = weigher(x, y, z) * Load(s.solid_angle + i);
      sum[0] += w;
      sum[1] += w * x;
      sum[2] += w * y;
      sum[3] += w * z;
      if (!blocked) continue;
      const Floats b = w * Load(s.blocked + i);
      sum[4] += b;
      sum[5] += b * x;
      sum[6] += b * y;
      sum[7] += b * z;
    }
  }
  void Finish(DirectSums* out) const {
    *out = {Sum(sum[0]), Sum(sum[1]), Sum(sum[2]), Sum(sum[3]), Sum(sum[4]), Sum(sum[5]), Sum(sum[6]), Sum(sum[7])};
  }
};

struct IndirectAccumulator {
  Floats light[6] = {};
  template <class Weigher>
  void AddTile(const SampleArrays& s, uint32_t tile, const Weigher& weigher) {
    for (uint32_t i = s.tile_begin[tile]; i < s.tile_begin[tile + 1]; i += kLanes) {
      const Floats w = weigher(Load(s.x + i), Load(s.y + i), Load(s.z + i));
      for (int c = 0; c < 6; ++c) light[c] += w * Load(s.light[c] + i);
    }
  }
  void Finish(IndirectSums* out) const {
    for (int c = 0; c < 6; ++c) out->light[c] = Sum(light[c]);
  }
};

template <class Accumulator, class Weigher, class Sums>
inline void SumTiles(const SampleArrays& s, const uint16_t* tiles, int count, const Weigher& weigher, Sums* out) {
  Accumulator sums;
  for (int i = 0; i < count; ++i) sums.AddTile(s, tiles[i], weigher);
  sums.Finish(out);
}

template <class Accumulator, class Sums>
void SumLobe(const SampleArrays& s, const uint16_t* tiles, int count, const LobeWeight& w, Sums* out) {
  SumTiles<Accumulator>(s, tiles, count, LobeWeigher(w), out);
}

template <class Accumulator, class Sums>
void SumCosine(const SampleArrays& s, const uint16_t* tiles, int count, Sums* out) {
  SumTiles<Accumulator>(s, tiles, count, CosineWeigher{}, out);
}

/// Rec. 709, as Luminance in common/base.
constexpr float kLuminance[3] = {0.2126f, 0.7152f, 0.0722f};

inline void Store(float* p, const Floats& v) { __builtin_memcpy(p, &v, sizeof v); }

template <class Weigher>
inline void ListTiles(const SampleArrays& s, const uint16_t* tiles, int count, const Weigher& weigher, LightList* out) {
  out->count = 0;
  for (int t = 0; t < count; ++t)
    for (uint32_t i = s.tile_begin[tiles[t]]; i < s.tile_begin[tiles[t] + 1]; i += kLanes) {
      const Floats weight = weigher(Load(s.x + i), Load(s.y + i), Load(s.z + i));
      Floats light[6];
      for (int c = 0; c < 6; ++c) light[c] = weight * Load(s.light[c] + i);
      const Floats strength = kLuminance[0] * light[0] + kLuminance[1] * light[1] + kLuminance[2] * light[2];
      if (!(Sum(strength) > 0)) continue;
      Store(out->channel[0] + out->count, strength);
      for (int c = 0; c < 3; ++c) {
        Store(out->channel[1 + c] + out->count, light[3 + c]);
        Store(out->channel[4 + c] + out->count, light[c]);
      }
      out->count += kLanes;
    }
}

void ListLobe(const SampleArrays& s, const uint16_t* tiles, int count, const LobeWeight& w, LightList* out) {
  ListTiles(s, tiles, count, LobeWeigher(w), out);
}

void ListCosine(const SampleArrays& s, const uint16_t* tiles, int count, LightList* out) {
  ListTiles(s, tiles, count, CosineWeigher{}, out);
}

template <class Weigher>
inline void ListVisibleTiles(const SampleArrays& s, const uint16_t* tiles, int count, const Weigher& weigher,
                             LightList* out) {
  out->count = 0;
  for (int t = 0; t < count; ++t)
    for (uint32_t i = s.tile_begin[tiles[t]]; i < s.tile_begin[tiles[t] + 1]; i += kLanes) {
      const Floats x = Load(s.x + i), y = Load(s.y + i), z = Load(s.z + i);
      const Floats strength = weigher(x, y, z) * Load(s.solid_angle + i) * (1.0f - Load(s.blocked + i));
      if (!(Sum(strength) > 0)) continue;
      Store(out->channel[0] + out->count, strength);
      Store(out->channel[1] + out->count, strength * x);
      Store(out->channel[2] + out->count, strength * y);
      Store(out->channel[3] + out->count, strength * z);
      out->count += kLanes;
    }
}

void ListVisibleLobe(const SampleArrays& s, const uint16_t* tiles, int count, const LobeWeight& w, LightList* out) {
  ListVisibleTiles(s, tiles, count, LobeWeigher(w), out);
}

void ListVisibleCosine(const SampleArrays& s, const uint16_t* tiles, int count, LightList* out) {
  ListVisibleTiles(s, tiles, count, CosineWeigher{}, out);
}

void Spread(const LightList& list, const float mean[3], float out[6]) {
  Floats sum[6] = {};
  for (int i = 0; i < list.count; i += kLanes) {
    const Floats strength = Load(list.channel[0] + i);
    const Floats inverse = 1.0f / (strength > 0.0f ? strength : Splat(1));
    const Floats x = Load(list.channel[1] + i) * inverse - mean[0];
    const Floats y = Load(list.channel[2] + i) * inverse - mean[1];
    const Floats z = Load(list.channel[3] + i) * inverse - mean[2];
    const Floats sx = strength * x, sy = strength * y, sz = strength * z;
    sum[0] += sx * x;
    sum[1] += sx * y;
    sum[2] += sx * z;
    sum[3] += sy * y;
    sum[4] += sy * z;
    sum[5] += sz * z;
  }
  for (int i = 0; i < 6; ++i) out[i] = Sum(sum[i]);
}

/// |m / s - c|^2 s grows as s |c|^2 / 2 - m . c: no division.
template <int kSummed>
void GroupChannels(const LightList& list, const float centres[kMaxLightGroups][3],
                   LightSums out[kMaxLightGroups]) {
  Floats sum[kMaxLightGroups][kSummed] = {};
  float half_square[kMaxLightGroups];
  for (int g = 0; g < kMaxLightGroups; ++g)
    half_square[g] = 0.5f * (centres[g][0] * centres[g][0] + centres[g][1] * centres[g][1] +
                             centres[g][2] * centres[g][2]);
  for (int i = 0; i < list.count; i += kLanes) {
    Floats value[kSummed], nearness[kMaxLightGroups];
    for (int c = 0; c < kSummed; ++c) value[c] = Load(list.channel[c] + i);
    for (int g = 0; g < kMaxLightGroups; ++g)
      nearness[g] = value[1] * centres[g][0] + value[2] * centres[g][1] + value[3] * centres[g][2] -
                    value[0] * half_square[g];
    const Floats low = nearness[0] >= nearness[1] ? nearness[0] : nearness[1];
    const Floats high = nearness[2] >= nearness[3] ? nearness[2] : nearness[3];
    const Ints in_low = low >= high, first = nearness[0] >= nearness[1], third = nearness[2] >= nearness[3];
    const Ints in_group[kMaxLightGroups] = {in_low & first, in_low & ~first, ~in_low & third,
                                            ~in_low & ~third};
    for (int g = 0; g < kMaxLightGroups; ++g)
      for (int c = 0; c < kSummed; ++c) sum[g][c] += in_group[g] ? value[c] : Splat(0);
  }
  for (int g = 0; g < kMaxLightGroups; ++g) {
    float* to[LightList::kChannels] = {&out[g].strength,  &out[g].moment[0], &out[g].moment[1],
                                       &out[g].moment[2], &out[g].colour[0], &out[g].colour[1],
                                       &out[g].colour[2]};
    for (int c = 0; c < kSummed; ++c) *to[c] = Sum(sum[g][c]);
  }
}

void Group(const LightList& list, const float centres[kMaxLightGroups][3], bool colour,
           LightSums out[kMaxLightGroups]) {
  if (colour) {
    GroupChannels<7>(list, centres, out);
  } else {
    GroupChannels<4>(list, centres, out);
  }
}

void Share(const LightList& list, const SharingLobe* lobe, int lobes, LightSums out[kMaxLightGroups]) {
  constexpr float kNothing = 1e-30f;  // no division by 0 beyond all lobes
  Floats sum[kMaxLightGroups][4] = {};
  for (int i = 0; i < list.count; i += kLanes) {
    Floats value[4], share[kMaxLightGroups], total = Splat(kNothing);
    for (int c = 0; c < 4; ++c) value[c] = Load(list.channel[c] + i);
    const Floats inverse = 1.0f / (value[0] > 0.0f ? value[0] : Splat(1));
    const Floats x = value[1] * inverse, y = value[2] * inverse, z = value[3] * inverse;
    for (int g = 0; g < lobes; ++g) {
      share[g] = lobe[g].factor * LobeWeigher(lobe[g].weight)(x, y, z);
      total += share[g];
    }
    const Floats scale = 1.0f / total;
    for (int g = 0; g < lobes; ++g)
      for (int c = 0; c < 4; ++c) sum[g][c] += share[g] * scale * value[c];
  }
  for (int g = 0; g < lobes; ++g) {
    out[g].strength = Sum(sum[g][0]);
    for (int c = 0; c < 3; ++c) out[g].moment[c] = Sum(sum[g][1 + c]);
  }
}

float Overlap(const LightList& list, const SharingLobe* lobe, int lobes) {
  Floats sum = {};
  for (int i = 0; i < list.count; i += kLanes) {
    const Floats strength = Load(list.channel[0] + i);
    const Floats inverse = 1.0f / (strength > 0.0f ? strength : Splat(1));
    const Floats x = Load(list.channel[1] + i) * inverse, y = Load(list.channel[2] + i) * inverse,
                 z = Load(list.channel[3] + i) * inverse;
    for (int g = 0; g < lobes; ++g) sum += strength * lobe[g].factor * LobeWeigher(lobe[g].weight)(x, y, z);
  }
  return Sum(sum);
}

inline uint32_t SignMask(const Floats& v) {
#ifdef __AVX__
  return static_cast<uint32_t>(__builtin_ia32_movmskps256(v));
#else
  float lane[kLanes];
  __builtin_memcpy(lane, &v, sizeof lane);
  uint32_t mask = 0;
  for (int i = 0; i < kLanes; ++i) mask |= static_cast<uint32_t>(lane[i] < 0) << i;
  return mask;
#endif
}

/// A cone that tiles are tested against, kLanes at a time.
struct ConeQuery {
  Floats x, y, z, cos_b, sin_b;
  explicit ConeQuery(const QueryCone& q)
      : x(Splat(q.x)), y(Splat(q.y)), z(Splat(q.z)), cos_b(Splat(q.cos_radius)), sin_b(Splat(q.sin_radius)) {}

  /// Bit l: cone i + l meets it. Two cones meet if the angle between their axes is at most the sum of their radii a + b;
  /// with a + b <= pi that is cos(angle) >= cos a cos b - sin a sin b.
  uint32_t Meets(const TileCones& cones, int i) const {
    const Floats cos_a = Load(cones.cos_radius + i), sin_a = Load(cones.sin_radius + i);
    const Floats cosine = x * Load(cones.x + i) + y * Load(cones.y + i) + z * Load(cones.z + i);
    // a + b > pi (cos a + cos b < 0) meets everything; padding (cos a = -4) meets nothing.
    const Floats bound = cos_a + cos_b < 0.0f ? Splat(-2) : cos_a * cos_b - sin_a * sin_b;
    const Floats outside = cos_a < -2.0f ? Splat(-1) : cosine - bound + 1e-6f;
    return ~SignMask(outside) & 0xFFu;
  }
};

/// Calls visit(tile, mask of kLanes tiles from there) for what the query meets, until it returns true.
template <class Visitor>
inline bool VisitTiles(const ConeTree& cones, const QueryCone& query, const Visitor& visit) {
  const ConeQuery cone(query);
  for (int g = 0; g < cones.groups.padded_count; g += kLanes)
    for (uint32_t groups = cone.Meets(cones.groups, g); groups; groups &= groups - 1) {
      const int tile = (g + __builtin_ctz(groups)) * kLanes;
      if (visit(tile, cone.Meets(cones.tiles, tile))) return true;
    }
  return false;
}

int SelectTiles(const ConeTree& cones, const QueryCone& query, uint16_t* out) {
  int count = 0;
  VisitTiles(cones, query, [&](int tile, uint32_t inside) {
    for (; inside; inside &= inside - 1) out[count++] = static_cast<uint16_t>(tile + __builtin_ctz(inside));
    return false;
  });
  return count;
}

bool AnyTile(const ConeTree& cones, const QueryCone& query) {
  return VisitTiles(cones, query, [](int, uint32_t inside) { return inside != 0; });
}

}  // namespace

const GatherKernels GLINT_KERNELS = {GLINT_KERNEL_LEVEL,
                                     SelectTiles,
                                     AnyTile,
                                     SumLobe<DirectAccumulator, DirectSums>,
                                     SumLobe<IndirectAccumulator, IndirectSums>,
                                     SumCosine<DirectAccumulator, DirectSums>,
                                     SumCosine<IndirectAccumulator, IndirectSums>,
                                     ListLobe,
                                     ListCosine,
                                     ListVisibleLobe,
                                     ListVisibleCosine,
                                     Spread,
                                     Group,
                                     Share,
                                     Overlap};

}  // namespace glint
