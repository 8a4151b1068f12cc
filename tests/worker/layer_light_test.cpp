#include "worker/layer_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "common/archive/lobe_codec.h"
#include "common/archive/row_sums.h"
#include "common/archive/transfer.h"
#include "common/base/frame.h"
#include "common/base/parallel.h"
#include "common/base/rng.h"
#include "common/scene/generate.h"
#include "tests/worker/gathered_layer.h"
#include "worker/gather.h"

namespace glint {
namespace {

/// The first two layers of a small scene, gathered.
class LayerLightTest : public testing::Test {
 protected:
  /// @param base_level  below 2: directions are left out
  explicit LayerLightTest(uint32_t vertices = 900, float exponent = 64, int base_level = 2,
                          int slice_lobes = 1)
      : scene_(*GenerateScene("goblets", {vertices, exponent})),
        domain_(BuildBakeDomain(scene_, {}, 1)),
        grid_(2, base_level),
        rays_(scene_, 1) {
    BakeSettings settings;
    settings.grid_level = 2;
    if (base_level < 2) settings.angular_tolerance = 0.05f;
    settings.base_level = base_level;
    settings.slice_lobes = slice_lobes;
    settings.lobe_tolerance = 0.02f;
    layers_ = GatherLayers({domain_, rays_, grid_}, settings, 2);
  }

  /// The same look-up by the reader that pictures use.
  HitLight Read(const TransferReader& reader, const LightQuery& query, int layer) const {
    HitLight light;
    TransferPoint point;
    if (!reader.Prepare(query.triangle, query.u, query.v, query.wo, &point)) return light;
    LayerLobes read;
    reader.Read(point, layers_[layer]->views, layer, &read);
    for (int i = 0; i < read.count; ++i) {
      light.alpha += read.lobe[i].alpha;
      light.moment +=
          Luminance(read.lobe[i].alpha) * MeanCosineFromKappa(read.lobe[i].kappa) * read.lobe[i].mu;
    }
    return light;
  }

  std::vector<LightQuery> RandomQueries(int count) const {
    std::vector<LightQuery> queries;
    CounterRng rng(7, 1);
    for (int i = 0; i < count; ++i) {
      const float a = rng.Uniform(), b = rng.Uniform(), z = 2 * rng.Uniform() - 1,
                  phi = 6.28f * rng.Uniform();
      const float r = std::sqrt(1 - z * z);
      queries.push_back({rng.Bits() % static_cast<uint32_t>(domain_.triangles.size()),
                         std::min(a, b),
                         std::max(a, b) - std::min(a, b),
                         {r * std::cos(phi), r * std::sin(phi), z}});
    }
    return queries;
  }

  /// @param moment  what first moments of layer 0 may differ by
  void ExpectReadersAgree(double moment = 1e-3) const {
    const std::vector<LightQuery> queries = RandomQueries(4000);
    for (int layer = 0; layer < 2; ++layer) {
      const Difference d = FromReader(layer, queries);
      EXPECT_GT(d.lit, 500);
      EXPECT_LT(d.alpha, 1e-3) << layer;
      // Unlike corners are kept apart here, and gathered into groups there.
      EXPECT_LT(d.moment, layer == 0 ? moment : 0.05) << layer;
    }
  }

  const Scene scene_;
  const BakeDomain domain_;
  const DirectionGrid grid_;
  const RayScene rays_;
  std::vector<std::unique_ptr<GatheredLayer>> layers_;

 private:
  /// Relative rms difference from the reader.
  struct Difference {
    double alpha = 0, moment = 0;
    int lit = 0;
  };

  Difference FromReader(int layer, const std::vector<LightQuery>& queries) const {
    const LayerLight light(domain_, grid_, layers_[layer]->views, layer, 2);
    std::vector<HitLight> answers(queries.size());
    light.Look(queries, answers.data());
    const TransferReader reader(domain_, grid_);
    double alpha = 0, moment = 0, norm = 0;
    Difference difference;
    for (size_t i = 0; i < queries.size(); ++i) {
      const HitLight want = Read(reader, queries[i], layer);
      EXPECT_TRUE(std::isfinite(answers[i].moment.x + answers[i].alpha.x));
      EXPECT_LE(glm::length(answers[i].moment), Luminance(answers[i].alpha) * 1.001f + 1e-6f);
      const double weight = glm::dot(want.alpha, want.alpha);
      const glm::vec3 da = answers[i].alpha - want.alpha, dm = answers[i].moment - want.moment;
      alpha += glm::dot(da, da);
      moment += glm::dot(dm, dm);
      norm += weight;
      difference.lit += weight > 0;
    }
    difference.alpha = std::sqrt(alpha / norm);
    difference.moment = std::sqrt(moment / norm);
    return difference;
  }
};

/// Goblets are double-sided.
class NestedLayerLightTest : public LayerLightTest {
 protected:
  NestedLayerLightTest() : LayerLightTest(900, 64, 0) {}
};

class SeveralLobesLayerLightTest : public LayerLightTest {
 protected:
  SeveralLobesLayerLightTest() : LayerLightTest(900, 64, 2, kMaxSliceLobes) {}
};

class NestedSeveralLobesLayerLightTest : public LayerLightTest {
 protected:
  NestedSeveralLobesLayerLightTest() : LayerLightTest(900, 64, 0, kMaxSliceLobes) {}
};

class GgxLayerLightTest : public LayerLightTest {
 protected:
  GgxLayerLightTest() : LayerLightTest(600, 0) {}
};

TEST_F(LayerLightTest, AnswersAsTheReaderOfPictures) { ExpectReadersAgree(); }

TEST_F(NestedLayerLightTest, AnswersAsTheReaderOfPictures) { ExpectReadersAgree(); }

TEST_F(SeveralLobesLayerLightTest, AnswersAsTheReaderOfPictures) {
  for (const std::unique_ptr<GatheredLayer>& layer : layers_) {
    ASSERT_EQ(layer->views.lobes(), static_cast<uint32_t>(kMaxSliceLobes));
    EXPECT_GT(layer->views.table(1, 0).entries(), 1000u);
  }
  ExpectReadersAgree(0.01);
}

TEST_F(NestedSeveralLobesLayerLightTest, AnswersAsTheReaderOfPictures) { ExpectReadersAgree(0.01); }

TEST_F(GgxLayerLightTest, AnswersAsTheReaderOfPictures) { ExpectReadersAgree(); }

TEST_F(LayerLightTest, OneByOneIsAsInBatches) {
  const std::vector<LightQuery> queries = RandomQueries(500);
  const LayerLight light(domain_, grid_, layers_[1]->views, 1, 1);
  std::vector<HitLight> together(queries.size());
  light.Look(queries, together.data());
  for (size_t i = 0; i < queries.size(); ++i) {
    HitLight alone;
    light.Look(std::span(&queries[i], 1), &alone);
    // Directions on a common edge of two grid triangles may be given to either.
    EXPECT_LT(glm::length(alone.alpha - together[i].alpha), 1e-4f);
    EXPECT_LT(glm::length(alone.moment - together[i].moment), 1e-4f);
  }
}

void ExpectEqual(const std::vector<HitLight>& a, const std::vector<HitLight>& b) {
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].alpha, b[i].alpha);
    EXPECT_EQ(a[i].moment, b[i].moment);
  }
}

TEST_F(LayerLightTest, RowsReadAsTheyAreReachedAnswerAsAllAtOnce) {
  const std::vector<LightQuery> queries = RandomQueries(500);
  for (int layer = 0; layer < 2; ++layer) {
    const LayerViews& views = layers_[layer]->views;
    const std::vector<uint64_t> sums = RowSums(views, domain_.row_count(), 2);
    const LayerLight at_once(domain_, grid_, views, layer, 2), reached(domain_, grid_, views, layer, 2, sums);
    std::vector<HitLight> expected(queries.size()), answers(queries.size());
    at_once.Look(queries, expected.data());
    ParallelFor(queries.size(), 4, 1,
                [&](size_t i, int) { reached.Look(std::span(&queries[i], 1), &answers[i]); });
    ExpectEqual(answers, expected);
    EXPECT_TRUE(reached.status().ok());
  }
}

TEST_F(LayerLightTest, TellsOfADamagedRowOnceItIsReached) {
  const LayerViews& views = layers_[1]->views;
  std::vector<uint64_t> sums = RowSums(views, domain_.row_count(), 1);
  const uint32_t row = domain_.triangles[5][0];
  sums[row] ^= 1;
  const LayerLight light(domain_, grid_, views, 1, 1, sums);
  const auto look = [&](uint32_t triangle) {
    HitLight answer;
    const LightQuery query{triangle, 0.3f, 0.3f, domain_.FaceNormal(triangle)};
    light.Look(std::span(&query, 1), &answer);
  };
  uint32_t elsewhere = 0;
  while (std::ranges::count(domain_.triangles[elsewhere], row) > 0) ++elsewhere;
  look(elsewhere);
  EXPECT_TRUE(light.status().ok());
  look(5);
  EXPECT_EQ(light.status().kind(), ErrorKind::kBadInput);
  EXPECT_NE(light.status().message().find(std::to_string(row)), std::string::npos);
}

TEST_F(LayerLightTest, ThreadsDoNotShow) {
  const std::vector<LightQuery> queries = RandomQueries(500);
  std::vector<HitLight> one(queries.size()), three(queries.size());
  LayerLight(domain_, grid_, layers_[0]->views, 0, 1).Look(queries, one.data());
  LayerLight(domain_, grid_, layers_[0]->views, 0, 3).Look(queries, three.data());
  ExpectEqual(one, three);
}

}  // namespace
}  // namespace glint
