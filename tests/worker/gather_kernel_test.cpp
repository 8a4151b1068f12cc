#include "worker/gather_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/base/frame.h"
#include "common/base/rng.h"
#include "worker/tile_cones.h"

namespace glint {
namespace {

/// Random samples in tiles of random length, with the plain double-precision sums beside them.
struct Fixture {
  std::vector<float> x, y, z, solid_angle, blocked, light[6];
  std::vector<uint32_t> begin{0};
  std::vector<uint8_t> tile_blocked;
  std::vector<uint16_t> tiles;

  explicit Fixture(int count) {
    CounterRng rng(3, 1);
    for (int t = 0; t < count; ++t) {
      const bool any = rng.Uniform() < 0.7f;
      const auto size = kLanes * (1 + rng.Bits() % 4);
      for (uint32_t i = 0; i < size; ++i) {
        const float cosine = rng.Uniform(), phi = 2 * kPi * rng.Uniform(), r = std::sqrt(1 - cosine * cosine);
        x.push_back(r * std::cos(phi));
        y.push_back(r * std::sin(phi));
        z.push_back(cosine);
        solid_angle.push_back(rng.Uniform() < 0.1f ? 0.0f : 0.01f * rng.Uniform());
        blocked.push_back(any && rng.Uniform() < 0.5f ? 1.0f : 0.0f);
        for (auto& l : light) l.push_back(solid_angle.back() * blocked.back() * rng.Uniform());
      }
      begin.push_back(static_cast<uint32_t>(x.size()));
      tile_blocked.push_back(any);
      if (t % 3 != 0) tiles.push_back(static_cast<uint16_t>(t));
    }
  }
  SampleArrays arrays() const {
    return {x.data(),
            y.data(),
            z.data(),
            solid_angle.data(),
            blocked.data(),
            {light[0].data(), light[1].data(), light[2].data(), light[3].data(), light[4].data(),
             light[5].data()},
            begin.data(),
            tile_blocked.data()};
  }
};

std::vector<const GatherKernels*> Levels() {
  std::vector<const GatherKernels*> levels = {&kGatherKernelsBase};
  if (&SelectGatherKernels() != &kGatherKernelsBase) levels.push_back(&SelectGatherKernels());
  return levels;
}

TEST(GatherKernel, LobeSumsEqualPlainSums) {
  const Fixture f(40);
  for (const GatherKernels* kernels : Levels())
    for (const float kappa : {0.0f, 1.0f, 30.0f, 1000.0f, 1e5f}) {
      const LobeWeight w{0.6f, 0.0f, 0.8f, kappa * 1.44269504f};
      double all = 0, all_x = 0, blocked = 0, blocked_z = 0, light[6] = {};
      for (const uint16_t t : f.tiles)
        for (uint32_t i = f.begin[t]; i < f.begin[t + 1]; ++i) {
          const double exponent = std::max(-87.3, kappa * (0.6 * f.x[i] + 0.8 * f.z[i] - 1.0));
          const double lobe = std::exp(exponent), weight = lobe * f.solid_angle[i];
          all += weight;
          all_x += weight * f.x[i];
          blocked += weight * f.blocked[i];
          blocked_z += weight * f.blocked[i] * f.z[i];
          for (int c = 0; c < 6; ++c) light[c] += lobe * f.light[c][i];
        }
      // The exponent's rounding, kappa * 2^-23, is the error that remains.
      const double bound = 2e-6 + kappa * 3e-7;
      DirectSums direct;
      kernels->direct_lobe(f.arrays(), f.tiles.data(), static_cast<int>(f.tiles.size()), w, &direct);
      EXPECT_NEAR(direct.all, all, bound * all + 1e-37) << kernels->level << " kappa " << kappa;
      EXPECT_NEAR(direct.all_x, all_x, bound * all + 1e-37);
      EXPECT_NEAR(direct.blocked, blocked, bound * all + 1e-37);
      EXPECT_NEAR(direct.blocked_z, blocked_z, bound * all + 1e-37);
      IndirectSums indirect;
      kernels->indirect_lobe(f.arrays(), f.tiles.data(), static_cast<int>(f.tiles.size()), w, &indirect);
      for (int c = 0; c < 6; ++c) EXPECT_NEAR(indirect.light[c], light[c], bound * all + 1e-37);
    }
}

TEST(GatherKernel, CosineSumsEqualPlainSums) {
  const Fixture f(40);
  for (const GatherKernels* kernels : Levels()) {
    double all = 0, blocked = 0;
    double light = 0;
    for (const uint16_t t : f.tiles)
      for (uint32_t i = f.begin[t]; i < f.begin[t + 1]; ++i) {
        all += double{f.z[i]} * f.solid_angle[i];
        blocked += double{f.z[i]} * f.solid_angle[i] * f.blocked[i];
        light += double{f.z[i]} * f.light[2][i];
      }
    DirectSums sums;
    kernels->direct_cosine(f.arrays(), f.tiles.data(), static_cast<int>(f.tiles.size()), &sums);
    EXPECT_NEAR(sums.all, all, 1e-5 * all);
    EXPECT_NEAR(sums.blocked, blocked, 1e-5 * all);
    IndirectSums indirect;
    kernels->indirect_cosine(f.arrays(), f.tiles.data(), static_cast<int>(f.tiles.size()), &indirect);
    EXPECT_NEAR(indirect.light[2], light, 1e-5 * light);
  }
}

TEST(GatherKernel, SelectTilesFindsEveryConeThatMeets) {
  CounterRng rng(5, 2);
  constexpr int kCount = 301;
  std::vector<float> z, radius;
  ConeList list;
  for (int i = 0; i < kCount; ++i) {
    const float cosine = 2 * rng.Uniform() - 1, phi = 2 * kPi * rng.Uniform(),
                r = std::sqrt(1 - cosine * cosine);
    z.push_back(cosine);
    // Wide ones among the narrow, so that some groups' bounds are the whole sphere.
    radius.push_back((i % 50 == 0 ? 3.0f : 0.5f) * rng.Uniform());
    list.Add({{r * std::cos(phi), r * std::sin(phi), cosine}, std::cos(radius[i]), std::sin(radius[i])});
  }
  list.Finish();
  for (const GatherKernels* kernels : Levels())
    for (const float b : {0.0f, 0.3f, 1.0f, 2.0f, 3.1f}) {
      uint16_t out[kCount];
      const QueryCone query{0, 0, 1, std::cos(b), std::sin(b)};
      const int count = kernels->select_tiles(list.tree(), query, out);
      EXPECT_EQ(kernels->any_tile(list.tree(), query), count > 0);
      EXPECT_TRUE(std::is_sorted(out, out + count));
      std::vector<bool> selected(kCount, false);
      for (int i = 0; i < count; ++i) {
        ASSERT_LT(out[i], kCount);
        selected[out[i]] = true;
      }
      for (int i = 0; i < kCount; ++i) {
        const float gap = std::acos(std::clamp(z[i], -1.0f, 1.0f)) - radius[i] - b;
        if (std::abs(gap) > 1e-3f) {
          EXPECT_EQ(selected[i], gap < 0) << kernels->level << " tile " << i << " b " << b;
        }
      }
    }
}

TEST(GatherKernel, NoTilesNoneSelected) {
  ConeList list;
  list.Finish();
  for (const GatherKernels* kernels : Levels()) {
    EXPECT_EQ(kernels->select_tiles(list.tree(), {0, 0, 1, -1, 0}, nullptr), 0);
    EXPECT_FALSE(kernels->any_tile(list.tree(), {0, 0, 1, -1, 0}));
  }
}

}  // namespace
}  // namespace glint
