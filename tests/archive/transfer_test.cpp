#include "common/archive/transfer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <memory>
#include <utility>

#include "common/archive/lobe_codec.h"
#include "common/base/rng.h"
#include "common/domain/bake_settings.h"

namespace glint {
namespace {

using Cell = std::pair<uint32_t, uint32_t>;  // row, column
constexpr uint32_t kDiffuse = 1000;          // columns from here on are the diffuse table's: front, back

/// One triangle on the floor, y up, Phong with one lobe and a diffuse part; tables with a few cells set.
class TransferTest : public testing::Test {
 protected:
  TransferTest() : grid_(2) {
    domain_.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}};
    domain_.normals.assign(3, glm::vec3(0, 1, 0));
    domain_.triangles = {{0, 1, 2}};
    domain_.triangle_double_sided = {0};
    domain_.specular = {glm::vec3(0.5f), glm::vec3(0.5f), glm::vec3(0.5f, 0.2f, 0.8f)};
    domain_.diffuse.assign(3, glm::vec3(0.3f, 0.2f, 0.1f));
    domain_.shape.assign(3, 0);
    domain_.double_sided.assign(3, 0);
    domain_.shapes = {FitBrdfShape(BrdfModel::kPhong, 50, {.max_lobes = 1})};
  }

  void MakeDoubleSided() {
    domain_.triangle_double_sided = {1};
    domain_.double_sided.assign(3, 1);
  }
  void SetDirect(Cell cell, const DirectLobe& lobe) { direct_[cell] = lobe; }
  /// @param lobe_index  0: the slice's first lobe
  void SetIndirect(Cell cell, const IndirectLobe& lobe, int lobe_index = 0) {
    indirect_[lobe_index][cell] = lobe;
  }

  /// Reads layer 0 or 1 at a point. Empty where nothing is reflected.
  LayerLobes Read(int layer, float u, float v, const glm::vec3& wo) {
    const LayerViews views = Build(layer);
    const TransferReader reader(domain_, grid_);
    LayerLobes lobes;
    if (reader.Prepare(0, u, v, wo, &point_)) reader.Read(point_, views, layer, &lobes);
    return lobes;
  }

  /// A direction of the grid, well above the floor and away from its normal.
  uint32_t SlantedColumn() const {
    for (uint32_t c = 0; c < grid_.size(); ++c) {
      const float y = grid_.direction(c).y;
      if (y > 0.5f && y < 0.7f) return c;
    }
    ADD_FAILURE() << "no such direction";
    return 0;
  }

  BakeDomain domain_;
  const DirectionGrid grid_;
  TransferPoint point_;  ///< of the last Read

 private:
  template <class Lobe, class Encode>
  std::vector<std::byte> Table(const std::map<Cell, Lobe>& cells, uint32_t first, uint32_t columns,
                               uint32_t entry_bytes, const Encode& encode) const {
    SliceTableBuilder builder(domain_.vertex_count(), columns, entry_bytes);
    for (uint32_t v = 0; v < domain_.vertex_count(); ++v) {
      std::vector<uint16_t> taken;
      std::vector<std::byte> entries;
      for (auto i = cells.lower_bound({v, first}); i != cells.end() && i->first < Cell{v, first + columns};
           ++i) {
        taken.push_back(static_cast<uint16_t>(i->first.second - first));
        entries.resize(entries.size() + entry_bytes);
        encode(i->second, entries.data() + entries.size() - entry_bytes);
      }
      builder.AppendRow(taken, entries);
    }
    return builder.Finish();
  }
  SliceTableView Keep(std::vector<std::byte> bytes) {
    bytes_.push_back(std::make_unique<std::vector<std::byte>>(std::move(bytes)));
    Result<SliceTableView> view = SliceTableView::Parse(*bytes_.back());
    EXPECT_TRUE(view.ok()) << view.status().message();
    return *view;
  }
  LayerViews Build(int layer) {
    LayerViews views;
    const uint32_t lobes = layer == 0 ? 1 : kMaxSliceLobes;
    for (uint32_t lobe = 0; lobe < lobes; ++lobe)
      for (const auto& [first, columns] : {Cell{0, grid_.size()}, Cell{kDiffuse, 2}})
        views.Add(
            lobe, first == kDiffuse,
            Keep(layer == 0 ? Table(direct_, first, columns, kDirectEntryBytes, EncodeDirect)
                            : Table(indirect_[lobe], first, columns, kIndirectEntryBytes, EncodeIndirect)));
    return views;
  }

  std::map<Cell, DirectLobe> direct_;
  std::array<std::map<Cell, IndirectLobe>, kMaxSliceLobes> indirect_;
  std::vector<std::unique_ptr<std::vector<std::byte>>> bytes_;
};

TEST_F(TransferTest, FreeSlicesGiveTheBrdf) {
  CounterRng rng(3, 1);
  for (int i = 0; i < 200; ++i) {
    const float a = rng.Uniform(), b = rng.Uniform(), u = std::min(a, b), v = std::max(a, b) - u;
    const float y = 0.05f + 0.95f * rng.Uniform(), phi = 6.28f * rng.Uniform(), r = std::sqrt(1 - y * y);
    const LayerLobes lobes = Read(0, u, v, {r * std::cos(phi), y, r * std::sin(phi)});
    ASSERT_EQ(lobes.count, 2);
    const BrdfLobe brdf = LookupSlice(domain_.shapes[0], y).lobe[0];
    const glm::vec3 specular = (1 - v) * domain_.specular[0] + v * domain_.specular[2];
    EXPECT_LT(glm::distance(lobes.lobe[0].alpha, brdf.Weight(specular)), 1e-5f);
    EXPECT_FALSE(lobes.lobe[0].cosine);
    if (brdf.above > 0.9999f) {
      // Away from the horizon the lobe stands in the plane of incidence as fitted, about the mirror
      // direction.
      const glm::vec3 mu(brdf.mu_x * std::cos(phi), brdf.mu_z, brdf.mu_x * std::sin(phi));
      EXPECT_LT(glm::distance(lobes.lobe[0].mu, mu), 1e-4f);
      EXPECT_NEAR(lobes.lobe[0].kappa / brdf.kappa, 1, 1e-4);
    }
    EXPECT_LT(glm::distance(lobes.lobe[1].alpha, domain_.diffuse[0]), 1e-6f);
    EXPECT_TRUE(lobes.lobe[1].cosine);
    EXPECT_LT(glm::distance(lobes.lobe[1].mu, glm::vec3(0, 1, 0)), 1e-6f);
    EXPECT_NEAR(lobes.lobe[1].kappa, kCosineKappa, 1e-5);
    EXPECT_EQ(Read(1, u, v, point_.wo).count, 0);
  }
}

TEST_F(TransferTest, DirectEntriesAreReproducedAtTheirCorner) {
  const uint32_t column = SlantedColumn();
  const DirectLobe lobe{0.25f, {0.1f, -0.05f, 0.02f}, 1.5f}, diffuse{0.5f, {0, -0.2f, 0.3f}, 2};
  const glm::vec3 wo = grid_.direction(column);
  const TransferLobe free = Read(0, 1, 0, wo).lobe[0];
  SetDirect({1, column}, lobe);
  SetDirect({1, kDiffuse}, diffuse);
  const LayerLobes lobes = Read(0, 1, 0, wo);
  ASSERT_EQ(lobes.count, 2);
  EXPECT_LT(glm::distance(lobes.lobe[0].alpha, 0.25f * free.alpha), 1e-4f);
  EXPECT_LT(glm::distance(lobes.lobe[0].mu, glm::normalize(free.mu + lobe.shift)), 1e-3f);
  EXPECT_NEAR(lobes.lobe[0].kappa / free.kappa, 1.5, 1e-2);
  EXPECT_LT(glm::distance(lobes.lobe[1].alpha, 0.5f * domain_.diffuse[1]), 1e-4f);
  EXPECT_LT(glm::distance(lobes.lobe[1].mu, glm::normalize(glm::vec3(0, 0.8f, 0.3f))), 1e-3f);
  EXPECT_NEAR(lobes.lobe[1].kappa, 2 * kCosineKappa, 1e-2);
  EXPECT_TRUE(lobes.lobe[1].cosine);
  // The other corners and directions do not see it.
  EXPECT_LT(glm::distance(Read(0, 0, 0, wo).lobe[0].alpha, free.alpha), 1e-6f);
}

TEST_F(TransferTest, IndirectEntriesAreReproducedAtTheirCorner) {
  const uint32_t column = SlantedColumn();
  const IndirectLobe lobe{{0.5f, 0.25f, 2}, glm::normalize(glm::vec3(-0.3f, -0.5f, 0.6f)), 40};
  const glm::vec3 wo = grid_.direction(column);
  const glm::vec3 weight = Read(0, 0, 1, wo).lobe[0].alpha;
  SetIndirect({2, column}, lobe);
  SetIndirect({2, kDiffuse}, lobe);
  const LayerLobes lobes = Read(1, 0, 1, wo);
  ASSERT_EQ(lobes.count, 2);
  EXPECT_LT(glm::distance(lobes.lobe[0].alpha, weight * lobe.alpha), 1e-3f);
  EXPECT_LT(glm::distance(lobes.lobe[1].alpha, domain_.diffuse[2] * lobe.alpha), 1e-3f);
  for (int i = 0; i < 2; ++i) {
    EXPECT_LT(glm::distance(lobes.lobe[i].mu, lobe.mu), 1e-3f);
    EXPECT_NEAR(lobes.lobe[i].kappa, 40, 0.1);
    EXPECT_FALSE(lobes.lobe[i].cosine);
  }
}

TEST_F(TransferTest, BlockedCornersFadeWithoutPullingTheLobe) {
  const uint32_t column = SlantedColumn();
  const glm::vec3 wo = grid_.direction(column);
  const TransferLobe free = Read(0, 0.25f, 0.25f, wo).lobe[0];
  SetDirect({0, column}, {0, {0.5f, 0.5f, 0.5f}, 4});
  const LayerLobes lobes = Read(0, 0.25f, 0.25f, wo);
  ASSERT_EQ(lobes.count, 2);
  EXPECT_LT(glm::distance(lobes.lobe[0].alpha, 0.5f * free.alpha), 1e-4f);  // 1 - u - v is blocked
  EXPECT_LT(glm::distance(lobes.lobe[0].mu, free.mu), 1e-4f);
  EXPECT_NEAR(lobes.lobe[0].kappa / free.kappa, 1, 1e-3);
  SetDirect({1, column}, {.fraction = 0});
  SetDirect({2, column}, {.fraction = 0});
  EXPECT_EQ(Read(0, 0.25f, 0.25f, wo).count, 1);  // only the diffuse lobe is left
}

TEST_F(TransferTest, NearLobesAreAveragedAndFarOnesKeptApart) {
  const uint32_t column = SlantedColumn();
  const glm::vec3 wo = grid_.direction(column);
  const glm::vec3 weight = Read(0, 0.5f, 0, wo).lobe[0].alpha;
  const glm::vec3 a = glm::normalize(glm::vec3(-0.6f, -0.5f, 0)),
                  b = glm::normalize(glm::vec3(0, -0.5f, 0.6f));
  SetIndirect({0, column}, {glm::vec3(1), a, 50});
  SetIndirect({1, column}, {glm::vec3(0.5f), b, 50});
  const LayerLobes apart = Read(1, 0.5f, 0, wo);
  ASSERT_EQ(apart.count, 2);
  EXPECT_LT(glm::distance(apart.lobe[0].mu, a), 1e-3f);
  EXPECT_LT(glm::distance(apart.lobe[1].mu, b), 1e-3f);
  EXPECT_LT(glm::distance(apart.lobe[0].alpha, 0.5f * weight), 1e-3f);
  EXPECT_LT(glm::distance(apart.lobe[1].alpha, 0.25f * weight), 1e-3f);

  const glm::vec3 close = glm::normalize(a + glm::vec3(0.05f, 0.1f, 0.05f));
  SetIndirect({1, column}, {glm::vec3(0.5f), close, 50});
  const LayerLobes near = Read(1, 0.5f, 0, wo);
  ASSERT_EQ(near.count, 1);
  EXPECT_LT(glm::distance(near.lobe[0].alpha, 0.75f * weight), 1e-3f);
  EXPECT_LT(glm::distance(near.lobe[0].mu, glm::normalize(2.0f * a + close)), 0.01f);
}

/// Total light of what was read.
glm::vec3 Light(const LayerLobes& lobes) {
  glm::vec3 sum(0);
  for (int i = 0; i < lobes.count; ++i) sum += lobes.lobe[i].alpha;
  return sum;
}

TEST_F(TransferTest, ASlicesLobesAreReadAsTheyWereStored) {
  const uint32_t column = SlantedColumn();
  const glm::vec3 wo = grid_.direction(column), weight = Read(0, 0, 1, wo).lobe[0].alpha;
  // Strongest first, as slices are stored.
  const IndirectLobe lobes[3] = {{{0.1f, 0.3f, 0.1f}, glm::normalize(glm::vec3(-1, 0.3f, 0)), 60},
                                 {{0.5f, 0.1f, 0.1f}, glm::normalize(glm::vec3(-1, 0.1f, 0)), 40},
                                 {{0.1f, 0.1f, 0.2f}, glm::normalize(glm::vec3(1, 0.1f, 0)), 20}};
  for (int i = 0; i < 3; ++i) SetIndirect({2, column}, lobes[i], i);
  const LayerLobes read = Read(1, 0, 1, wo);
  ASSERT_EQ(read.count, 3);  // near ones, too, stay what they are
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(glm::distance(read.lobe[i].alpha, weight * lobes[i].alpha), 1e-3f);
    EXPECT_LT(glm::distance(read.lobe[i].mu, lobes[i].mu), 1e-3f);
    EXPECT_NEAR(read.lobe[i].kappa / lobes[i].kappa, 1, 1e-3);
  }
}

TEST_F(TransferTest, LobesAreMatchedBetweenCorners) {
  const uint32_t column = SlantedColumn();
  const glm::vec3 wo = grid_.direction(column), weight = Read(0, 0.5f, 0, wo).lobe[0].alpha;
  const glm::vec3 left = glm::normalize(glm::vec3(-1, 0.2f, 0)),
                  right = glm::normalize(glm::vec3(1, 0.2f, 0));
  const glm::vec3 near_left = glm::normalize(left + glm::vec3(0, 0.1f, 0.05f));
  SetIndirect({0, column}, {glm::vec3(1), left, 50}, 0);
  SetIndirect({0, column}, {glm::vec3(0.5f), right, 50}, 1);
  SetIndirect({1, column}, {glm::vec3(0.75f), right, 50}, 0);  // stronger here: another order
  SetIndirect({1, column}, {glm::vec3(0.5f), near_left, 50}, 1);
  const LayerLobes read = Read(1, 0.5f, 0, wo);
  ASSERT_EQ(read.count, 2);
  EXPECT_LT(glm::distance(read.lobe[0].alpha, 0.75f * weight), 1e-3f);
  EXPECT_LT(glm::distance(read.lobe[0].mu, glm::normalize(2.0f * left + near_left)), 0.01f);
  EXPECT_LT(glm::distance(read.lobe[1].alpha, 0.625f * weight), 1e-3f);
  EXPECT_LT(glm::distance(read.lobe[1].mu, right), 1e-3f);
}

TEST_F(TransferTest, ManyUnlikeLobesLoseNoLight) {
  CounterRng rng(9, 4);
  glm::vec3 sum(0);
  const uint32_t column = SlantedColumn();
  const glm::vec3 wo = grid_.direction(column), weight = Read(0, 0.3f, 0.3f, wo).lobe[0].alpha;
  for (uint32_t v = 0; v < 3; ++v)
    for (int i = 0; i < kMaxSliceLobes; ++i) {
      const float z = 2 * rng.Uniform() - 1, phi = 6.28f * rng.Uniform(), r = std::sqrt(1 - z * z);
      const glm::vec3 alpha(0.5f, 0.25f, 0.125f);
      SetIndirect({v, column}, {alpha, {r * std::cos(phi), r * std::sin(phi), z}, 1e4f}, i);
      sum += (v == 0 ? 0.4f : 0.3f) * alpha;
    }
  const LayerLobes read = Read(1, 0.3f, 0.3f, wo);
  EXPECT_LE(read.count, kMaxGroups);
  EXPECT_LT(glm::distance(Light(read), sum * weight), 2e-3f);
}

TEST_F(TransferTest, SingleSidedSurfacesReflectNothingFromBehind) {
  EXPECT_EQ(Read(0, 0.3f, 0.3f, {0, -1, 0}).count, 0);
  EXPECT_EQ(Read(0, 0.3f, 0.3f, {0, 1, 0}).count, 2);
}

TEST_F(TransferTest, DoubleSidedSurfacesHaveTheirBackSidesSlices) {
  MakeDoubleSided();
  const glm::vec3 wo = glm::normalize(glm::vec3(0.5f, -0.8f, 0.1f));
  const LayerLobes back = Read(0, 0.3f, 0.3f, wo);
  ASSERT_EQ(back.count, 2);
  EXPECT_TRUE(point_.back);
  EXPECT_LT(glm::distance(point_.normal, glm::vec3(0, -1, 0)), 1e-6f);
  EXPECT_LT(glm::distance(back.lobe[1].mu, glm::vec3(0, -1, 0)), 1e-6f);
  EXPECT_LT(back.lobe[0].mu.y, -0.5f);
  EXPECT_LT(back.lobe[0].mu.x, 0);
  // The front's diffuse slices are not the back's.
  for (uint32_t v = 0; v < 3; ++v) SetDirect({v, kDiffuse}, {.fraction = 0});
  EXPECT_EQ(Read(0, 0.3f, 0.3f, wo).count, 2);
  for (uint32_t v = 0; v < 3; ++v) SetDirect({v, kDiffuse + 1}, {.fraction = 0});
  EXPECT_EQ(Read(0, 0.3f, 0.3f, wo).count, 1);
}

TEST_F(TransferTest, DirectionsUnderTheHorizonAreNotAsked) {
  // Whatever stands in the tables for directions under the surface must not show.
  CounterRng rng(5, 2);
  int crossed = 0;
  for (int i = 0; i < 300; ++i) {
    const float y = 0.001f + 0.05f * rng.Uniform(), phi = 6.28f * rng.Uniform(), r = std::sqrt(1 - y * y);
    const glm::vec3 wo(r * std::cos(phi), y, r * std::sin(phi));
    const TransferLobe free = Read(0, 0.3f, 0.3f, wo).lobe[0];
    float total = 0;
    bool under = false;
    for (int k = 0; k < 9; ++k) {
      total += point_.corner_weight[k];
      if (grid_.direction(point_.column[k % 3]).y > 0) continue;
      under = true;
      EXPECT_EQ(point_.corner_weight[k], 0.0f);
      for (uint32_t v = 0; v < 3; ++v) SetDirect({v, point_.column[k % 3]}, {.fraction = 0});
    }
    EXPECT_NEAR(total, 1, 1e-5);
    if (!under) continue;
    ++crossed;
    const LayerLobes lobes = Read(0, 0.3f, 0.3f, wo);
    ASSERT_EQ(lobes.count, 2);
    EXPECT_EQ(lobes.lobe[0].alpha, free.alpha);
    EXPECT_EQ(lobes.lobe[0].mu, free.mu);
  }
  EXPECT_GT(crossed, 50);
}

TEST_F(TransferTest, FiniteAtGrazingAndOnBadGeometry) {
  MakeDoubleSided();
  for (uint32_t c = 0; c < grid_.size(); c += 2)
    for (uint32_t v = 0; v < 3; ++v) {
      SetDirect({v, c}, {0.5f, {-2, 2, -2}, 0x1p20f});
      SetIndirect({v, c}, {glm::vec3(65504), {0, -1, 0}, kMaxKappa});
    }
  const auto check = [this] {
    for (const float y : {0.0f, 1e-30f, 1e-7f, 1e-4f, 0.01f, 1.0f})
      for (const float side : {1.0f, -1.0f})
        for (int layer = 0; layer < 2; ++layer) {
          const glm::vec3 wo = glm::normalize(glm::vec3(y < 1 ? 0.6f : 0.0f, side * y, y < 1 ? 0.8f : 0.0f));
          const LayerLobes lobes = Read(layer, 0.2f, 0.3f, wo);
          for (int i = 0; i < lobes.count; ++i) {
            const TransferLobe& l = lobes.lobe[i];
            EXPECT_TRUE(std::isfinite(l.alpha.x + l.alpha.y + l.alpha.z)) << y;
            EXPECT_NEAR(glm::length(l.mu), 1, 1e-4) << y;
            EXPECT_TRUE(l.kappa >= 0 && std::isfinite(l.kappa)) << y;
          }
        }
  };
  check();
  domain_.normals = {{0, 1, 0}, {0, -1, 0}, glm::normalize(glm::vec3(1, -0.1f, 0))};  // against the face
  check();
  domain_.positions[2] = domain_.positions[1];  // no area
  check();
}

}  // namespace
}  // namespace glint
