#include "common/domain/bake_nodes.h"

#include <gtest/gtest.h>

#include <array>
#include <glm/geometric.hpp>

#include "common/base/rng.h"
#include "common/domain/bake_domain.h"
#include "common/domain/facet_rows.h"

namespace glint {
namespace {

/// Two sheets of 3 x 3 squares at a right angle. They have vertices of their own where they meet, which are
/// the same in all that counts.
BakeDomain Planes() {
  constexpr uint32_t kSide = 4;
  BakeDomain domain;
  for (const bool upright : {false, true}) {
    const auto first = static_cast<uint32_t>(domain.positions.size());
    for (uint32_t y = 0; y < kSide; ++y)
      for (uint32_t x = 0; x < kSide; ++x) {
        const auto a = static_cast<float>(x), b = static_cast<float>(y);
        domain.positions.push_back(upright ? glm::vec3(a, b, 0) : glm::vec3(a, 0, b));
        domain.normals.push_back(upright && y > 0 ? glm::vec3(0, 0, 1) : glm::vec3(0, 1, 0));
      }
    for (uint32_t y = 0; y + 1 < kSide; ++y)
      for (uint32_t x = 0; x + 1 < kSide; ++x) {
        const uint32_t v = first + y * kSide + x;
        domain.triangles.push_back({v, v + 1, v + kSide + 1});
        domain.triangles.push_back({v, v + kSide + 1, v + kSide});
      }
  }
  domain.triangle_double_sided.assign(domain.triangles.size(), 0);
  domain.specular.assign(domain.positions.size(), glm::vec3(0.5f));
  domain.diffuse.assign(domain.positions.size(), glm::vec3(0));
  domain.shape.assign(domain.positions.size(), 0);
  domain.double_sided.assign(domain.positions.size(), 0);
  return domain;
}

/// Every third node baked, the others predicted from two of these.
BakeNodes SomeNodes(const BakeDomain& domain) {
  const std::vector<uint32_t> splits = *FacetTree::Balance(
      domain.triangles, WeldVertices(domain), {0, 3, static_cast<uint32_t>(domain.triangles.size())});
  BakeNodes nodes = *SplitNodes(domain, splits);
  const auto count = static_cast<uint32_t>(nodes.first.size() - 1);
  for (uint32_t n = 0; n < count; n += 3) nodes.rows.push_back(n);
  const auto rows = static_cast<uint32_t>(nodes.rows.size());
  nodes.first.assign(1, 0);
  for (uint32_t n = 0; n < count; ++n) {
    if (n % 3 == 0) {
      nodes.weights.push_back({n / 3, kWholeWeight});
    } else {
      nodes.weights.push_back({n / 3, 20000});
      nodes.weights.push_back({(n / 3 + 1) % rows, kWholeWeight - 20000});
    }
    nodes.first.push_back(static_cast<uint32_t>(nodes.weights.size()));
  }
  return nodes;
}

TEST(BakeNodesTest, SurviveTheirBytes) {
  BakeDomain domain = Planes();
  const BakeNodes nodes = SomeNodes(domain);
  const std::vector<std::byte> bytes = EncodeNodes(nodes);
  const Result<BakeNodes> read = DecodeNodes(bytes, domain, nodes.rows.size());
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_EQ(EncodeNodes(*read), bytes);
  EXPECT_EQ(read->facets.middles().size(), nodes.facets.middles().size());
}

TEST(BakeNodesTest, RefuseDamagedBytes) {
  const BakeDomain domain = Planes();
  const BakeNodes nodes = SomeNodes(domain);
  const std::vector<std::byte> bytes = EncodeNodes(nodes);
  for (size_t length = 1; length < bytes.size(); ++length)
    EXPECT_FALSE(DecodeNodes(std::span(bytes).first(length), domain, nodes.rows.size()).ok()) << length;
  EXPECT_FALSE(DecodeNodes(bytes, domain, nodes.rows.size() + 1).ok());
  EXPECT_FALSE(DecodeNodes({}, domain, nodes.rows.size()).ok());
  // Whatever a byte becomes, what is read can be used.
  CounterRng rng(1, 2, 3, 4);
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::vector<std::byte> damaged = bytes;
    damaged[i] = static_cast<std::byte>(rng.Bits());
    const Result<BakeNodes> read = DecodeNodes(damaged, domain, nodes.rows.size());
    if (!read.ok()) continue;
    for (const RowWeight& w : read->weights) EXPECT_LT(w.row, nodes.rows.size());
  }
}

TEST(BakeNodesTest, MiddlesLieOnTheSurface) {
  BakeDomain domain = Planes();
  domain.nodes = SomeNodes(domain);
  const auto& middles = domain.nodes.facets.middles();
  ASSERT_GT(middles.size(), 6u);
  for (uint32_t m = 0; m < middles.size(); ++m) {
    const glm::vec3 halved =
        0.5f * (domain.NodePosition(middles[m].ends[0]) + domain.NodePosition(middles[m].ends[1]));
    const glm::vec3 off = domain.NodePosition(domain.vertex_count() + m) - halved;
    EXPECT_LT(glm::dot(off, off), 1e-10f);
    const BakeVertex vertex = domain.Node(domain.vertex_count() + m);
    EXPECT_NEAR(glm::dot(vertex.normal, vertex.normal), 1, 1e-5f);
  }
}

TEST(BakeNodesTest, RowsAreContinuousOverFacets) {
  BakeDomain domain = Planes();
  domain.nodes = SomeNodes(domain);
  const FacetRows rows(domain);
  std::vector<float> before(domain.row_count()), after(domain.row_count());
  auto read = [&](uint32_t triangle, float u, float v, std::vector<float>* out) {
    std::fill(out->begin(), out->end(), 0.0f);
    std::array<float, 3> weight = {1 - u - v, u, v};
    float sum = 0;
    for (const FacetRows::Row& row : rows.Locate(triangle, &weight)) {
      (*out)[row.row] += row.At(weight);
      sum += row.At(weight);
    }
    EXPECT_NEAR(sum, 1, 1e-5f);
  };
  for (uint32_t t = 0; t < 4; ++t)
    for (int i = 0; i < 200; ++i) {  // along a line, in steps too small for weights to change much
      const float u = 0.1f + 0.8f * static_cast<float>(i) / 200, v = 0.05f;
      read(t, u, v, &before);
      read(t, u + 1e-4f, v, &after);
      for (size_t r = 0; r < before.size(); ++r) EXPECT_NEAR(before[r], after[r], 2e-3f);
    }
}

/// Shared edges of a domain's triangles, as corners of each of the two.
struct SharedEdge {
  uint32_t triangle[2];
  int from[2], to[2];
};

std::vector<SharedEdge> SharedEdges(const BakeDomain& domain) {
  const std::vector<uint32_t> welded = WeldVertices(domain);
  std::vector<SharedEdge> edges;
  const auto count = static_cast<uint32_t>(domain.triangles.size());
  for (uint32_t a = 0; a < count; ++a)
    for (uint32_t b = a + 1; b < count; ++b)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const int i1 = (i + 1) % 3, j1 = (j + 1) % 3;
          const auto &s = domain.triangles[a], &t = domain.triangles[b];
          if (welded[s[i]] == welded[t[j1]] && welded[s[i1]] == welded[t[j]])
            edges.push_back({{a, b}, {i, j1}, {i1, j}});
        }
  return edges;
}

TEST(BakeNodesTest, RowsAreTheSameFromBothSidesOfAnEdge) {
  BakeDomain domain = Planes();
  const std::vector<SharedEdge> edges = SharedEdges(domain);
  ASSERT_GT(edges.size(), 10u);
  for (uint32_t seed = 1; seed < 8; ++seed) {
    CounterRng rng(seed, 5, 6, 7);
    std::vector<uint32_t> splits;
    const auto triangles = static_cast<uint32_t>(domain.triangles.size());
    for (uint32_t t = 0; t < triangles; ++t)
      if (rng.Uniform() < 0.3f) splits.push_back(t);
    const auto first = static_cast<uint32_t>(splits.size());
    for (uint32_t k = 0; k < 4 * first; ++k)
      if (rng.Uniform() < 0.3f) splits.push_back(triangles + k);
    splits = *FacetTree::Balance(domain.triangles, WeldVertices(domain), splits);
    domain.nodes = *SplitNodes(domain, splits);
    // Every node is baked that is not the same as another one.
    std::vector<uint32_t> same = WeldVertices(domain);
    const auto& middles = domain.nodes.facets.welded_middles();
    same.insert(same.end(), middles.begin(), middles.end());
    std::vector<uint32_t> row(same.size());
    for (uint32_t n = 0; n < same.size(); ++n)
      if (same[n] == n)
        row[n] = static_cast<uint32_t>(domain.nodes.rows.size()), domain.nodes.rows.push_back(n);
    domain.nodes.first.assign(1, 0);
    for (const uint32_t n : same) {
      domain.nodes.weights.push_back({row[n], kWholeWeight});
      domain.nodes.first.push_back(static_cast<uint32_t>(domain.nodes.weights.size()));
    }
    const FacetRows rows(domain);
    for (const SharedEdge& edge : edges)
      for (const float at : {0.0f, 0.1f, 0.25f, 0.3f, 0.5f, 0.6f, 0.75f, 0.9f}) {
        std::vector<float> seen[2];
        for (int side = 0; side < 2; ++side) {
          seen[side].assign(domain.row_count(), 0);
          std::array<float, 3> weight{};
          weight[edge.from[side]] = 1 - at;
          weight[edge.to[side]] = at;
          for (const FacetRows::Row& r : rows.Locate(edge.triangle[side], &weight))
            seen[side][r.row] += r.At(weight);
        }
        for (size_t r = 0; r < seen[0].size(); ++r) EXPECT_NEAR(seen[0][r], seen[1][r], 1e-5f);
      }
  }
}

TEST(BakeNodesTest, EveryVertexAnswersForItself) {
  const BakeDomain domain = Planes();
  EXPECT_TRUE(domain.nodes.every_vertex());
  EXPECT_TRUE(EncodeNodes(domain.nodes).empty());
  EXPECT_EQ(domain.row_count(), domain.vertex_count());
  const FacetRows rows(domain);
  std::array<float, 3> weight = {0.5f, 0.25f, 0.25f};
  const auto found = rows.Locate(1, &weight);
  ASSERT_EQ(found.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(found[i].row, domain.triangles[1][i]);
    EXPECT_EQ(found[i].At(weight), weight[i]);
  }
}

}  // namespace
}  // namespace glint
