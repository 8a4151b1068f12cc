#include "common/domain/facet_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <vector>

#include "common/base/rng.h"
#include "common/scene/scene.h"

namespace glint {
namespace {

using Triangles = std::vector<std::array<uint32_t, 3>>;

/// A strip of four triangles over six vertices, of which the last two are the same as two others.
const Triangles kStrip = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {6, 5, 7}};
const std::vector<uint32_t> kWelded = {0, 1, 2, 3, 4, 5, 4, 3};

/// A few rounds of splits at random.
std::vector<uint32_t> RandomSplits(uint32_t seed, int rounds) {
  CounterRng rng(seed, 0, 0, 1);
  std::vector<uint32_t> splits;
  for (int round = 0; round < rounds; ++round) {
    const std::set<uint32_t> done(splits.begin(), splits.end());
    const size_t elements = kStrip.size() + 4 * splits.size();
    for (uint32_t e = 0; e < elements; ++e)
      if (done.count(e) == 0 && rng.Uniform() < 0.3f) splits.push_back(e);
    Result<std::vector<uint32_t>> balanced = FacetTree::Balance(kStrip, kWelded, splits);
    EXPECT_TRUE(balanced.ok()) << balanced.status().message();
    splits = std::move(balanced).value();
  }
  return splits;
}

FacetTree MakeTree(const std::vector<uint32_t>& splits) {
  Result<FacetTree> tree = FacetTree::Make(kStrip, kWelded, splits);
  EXPECT_TRUE(tree.ok()) << tree.status().message();
  return std::move(tree).value();
}

TEST(FacetTreeTest, UnsplitFacetsAreTheTriangles) {
  const FacetTree tree = MakeTree({});
  std::array<float, 3> weight = {0.2f, 0.3f, 0.5f};
  EXPECT_TRUE(tree.unsplit());
  EXPECT_EQ(tree.Locate(2, &weight), 2u);
  EXPECT_EQ(weight[1], 0.3f);
}

/// Barycentric place of a node on one of its triangles; clears `here` where it is told on another one.
std::array<float, 3> OnTriangle(const FacetTree& tree, uint32_t node, uint32_t triangle, bool* here) {
  std::array<float, 3> place{};
  if (node < kWelded.size()) {
    const auto& t = kStrip[triangle];
    const auto corner = std::find(t.begin(), t.end(), node) - t.begin();
    EXPECT_LT(corner, 3) << "a facet's corner is none of its triangle's";
    if (corner < 3) place[corner] = 1;
    return place;
  }
  const SurfacePlace& middle = tree.middles()[node - kWelded.size()].place;
  *here = *here && middle.triangle == triangle;
  return {1 - middle.u - middle.v, middle.u, middle.v};
}

TEST(FacetTreeTest, WeightsGiveThePlaceBack) {
  for (uint32_t seed = 1; seed < 12; ++seed) {
    const FacetTree tree = MakeTree(RandomSplits(seed, 4));
    CounterRng rng(seed, 1, 0, 1);
    int checked = 0;
    for (int i = 0; i < 400; ++i) {
      const uint32_t triangle = rng.Bits() % 4;
      float u = rng.Uniform(), v = rng.Uniform();
      if (u + v > 1) u = 1 - u, v = 1 - v;
      std::array<float, 3> weight = {1 - u - v, u, v};
      const uint32_t part = tree.Locate(triangle, &weight);
      ASSERT_TRUE(tree.is_facet(part));
      // A middle's place is told on one of its triangles; only facets with all corners on this one are
      // checked.
      std::array<float, 3> place{};
      bool here = true;
      for (int c = 0; c < 3; ++c) {
        EXPECT_GE(weight[c], -1e-5f);
        const std::array<float, 3> corner = OnTriangle(tree, tree.corners(part)[c], triangle, &here);
        for (int k = 0; k < 3; ++k) place[k] += weight[c] * corner[k];
      }
      checked += here;
      if (!here) continue;
      EXPECT_NEAR(place[1], u, 1e-5f);
      EXPECT_NEAR(place[2], v, 1e-5f);
    }
    EXPECT_GT(checked, 40);
  }
}

TEST(FacetTreeTest, FacetsConform) {
  for (uint32_t seed = 1; seed < 12; ++seed) {
    const FacetTree tree = MakeTree(RandomSplits(seed, 4));
    auto weld = [&](uint32_t node) {
      return node < kWelded.size() ? kWelded[node] : tree.welded_middles()[node - kWelded.size()];
    };
    std::map<std::pair<uint32_t, uint32_t>, int> uses;
    std::set<std::pair<uint32_t, uint32_t>> halved;
    for (const FacetTree::Middle& m : tree.middles())
      halved.insert(std::minmax(weld(m.ends[0]), weld(m.ends[1])));
    for (uint32_t part = 0; part < tree.parts(); ++part) {
      if (!tree.is_facet(part)) continue;
      for (int i = 0; i < 3; ++i) {
        const uint32_t a = weld(tree.corners(part)[i]), b = weld(tree.corners(part)[(i + 1) % 3]);
        const std::pair<uint32_t, uint32_t> edge = std::minmax(a, b);
        ++uses[edge];
        EXPECT_EQ(halved.count(edge), 0u) << "a node lies on a facet's edge";
      }
    }
    for (const auto& [edge, count] : uses) EXPECT_LE(count, 2);
  }
}

TEST(FacetTreeTest, NeighboursAreAtMostOneSplitApart) {
  for (uint32_t seed = 1; seed < 12; ++seed) {
    const std::vector<uint32_t> splits = RandomSplits(seed, 4);
    const FacetTree tree = MakeTree(splits);
    auto weld = [&](uint32_t node) {
      return node < kWelded.size() ? kWelded[node] : tree.welded_middles()[node - kWelded.size()];
    };
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middle;
    for (uint32_t m = 0; m < tree.middles().size(); ++m) {
      const auto& ends = tree.middles()[m].ends;
      middle.emplace(std::minmax(weld(ends[0]), weld(ends[1])), static_cast<uint32_t>(kWelded.size()) + m);
    }
    const std::set<uint32_t> split(splits.begin(), splits.end());
    const size_t elements = kStrip.size() + 4 * splits.size();
    for (uint32_t e = 0; e < elements; ++e) {
      if (split.count(e) > 0) continue;
      for (int i = 0; i < 3; ++i) {
        const uint32_t a = weld(tree.corners(e)[i]), b = weld(tree.corners(e)[(i + 1) % 3]);
        const auto halved = middle.find(std::minmax(a, b));
        if (halved == middle.end()) continue;
        const uint32_t m = weld(halved->second);
        EXPECT_EQ(middle.count(std::minmax(a, m)) + middle.count(std::minmax(m, b)), 0u)
            << "beside element " << e << ", seed " << seed;
      }
    }
  }
}

TEST(FacetTreeTest, NodesKeepTheirNumbers) {
  std::vector<uint32_t> splits = RandomSplits(3, 2);
  const FacetTree before = MakeTree(splits);
  const size_t elements = kStrip.size() + 4 * splits.size();
  const std::vector<uint32_t> first = splits;
  for (uint32_t e = 0; e < elements; ++e)
    if (std::find(first.begin(), first.end(), e) == first.end()) splits.push_back(e);
  splits = *FacetTree::Balance(kStrip, kWelded, splits);
  const FacetTree after = MakeTree(splits);
  // Those that only cutting through added come last, and may have made way.
  size_t same = 0;
  while (same < before.middles().size() && before.middles()[same].ends == after.middles()[same].ends &&
         before.middles()[same].place.triangle == after.middles()[same].place.triangle)
    ++same;
  size_t own = 0;
  for (size_t i = 0; i < before.middles().size(); ++i)
    own += before.welded_middles()[i] == kWelded.size() + i;
  EXPECT_GE(same, own);
}

TEST(FacetTreeTest, RefusesWhatCannotBe) {
  EXPECT_FALSE(FacetTree::Make(kStrip, kWelded, std::vector<uint32_t>{4}).ok()) << "no element yet";
  EXPECT_FALSE(FacetTree::Make(kStrip, kWelded, std::vector<uint32_t>{0, 0}).ok()) << "split twice";
  EXPECT_FALSE(FacetTree::Make(kStrip, kWelded, std::vector<uint32_t>{0, 4 + 1}).ok()) << "unbalanced";
  std::vector<uint32_t> deep = {0};
  for (int i = 0; i < FacetTree::kMaxDepth; ++i) deep.push_back(static_cast<uint32_t>(4 + 4 * i + 3));
  EXPECT_FALSE(FacetTree::Balance(kStrip, kWelded, deep).ok()) << "too deep";
}

}  // namespace
}  // namespace glint
