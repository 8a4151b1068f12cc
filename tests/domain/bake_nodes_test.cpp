#include "common/domain/bake_nodes.h"

#include <gtest/gtest.h>

#include <array>

#include "common/base/rng.h"
#include "common/domain/bake_domain.h"
#include "common/domain/facet_rows.h"
#include "common/scene/generate.h"

namespace glint {
namespace {

BakeDomain Planes() { return BuildBakeDomain(*GenerateScene("planes", {40, 32}), BrdfFitOptions{}, 1); }

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
  EXPECT_EQ(HashNodes(*read), HashNodes(nodes));
  EXPECT_NE(HashNodes(nodes), Digest{});
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

TEST(BakeNodesTest, EveryVertexAnswersForItself) {
  const BakeDomain domain = Planes();
  EXPECT_TRUE(domain.nodes.every_vertex());
  EXPECT_EQ(HashNodes(domain.nodes), Digest{});
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
