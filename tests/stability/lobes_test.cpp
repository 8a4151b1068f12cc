// Lobes at the ends of what they can hold, and mixtures that have no mean.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "common/archive/lobe_codec.h"
#include "common/base/frame.h"
#include "common/lobes/vmf.h"
#include "tests/stability/stability_fixture.h"
#include "worker/layer_light.h"

namespace glint::stability {
namespace {

constexpr double kPi = std::numbers::pi;

rc::Gen<float> Unit() {
  return rc::gen::map(rc::gen::inRange(0, 1 << 20),
                      [](int i) { return (static_cast<float>(i) + 0.5f) * 0x1p-20f; });
}

/// Also the axes and their opposites, where frames and maps have their seams.
rc::Gen<glm::vec3> Direction() {
  const auto anywhere = rc::gen::map(rc::gen::pair(Unit(), Unit()), [](const std::pair<float, float>& u) {
    return SampleVmf({}, u.first, u.second);
  });
  return rc::gen::oneOf(anywhere,
                        rc::gen::element(glm::vec3(1, 0, 0), glm::vec3(-1, 0, 0), glm::vec3(0, 1, 0),
                                         glm::vec3(0, -1, 0), glm::vec3(0, 0, 1), glm::vec3(0, 0, -1)));
}

/// From uniform to sharper than a lobe can be.
rc::Gen<float> Kappa() {
  const auto anywhere = rc::gen::map(Unit(), [](float u) { return std::pow(10.0f, 12 * u - 4); });
  return rc::gen::oneOf(anywhere, rc::gen::element(0.0f, 1e-30f, kMaxKappa, 1e20f));
}

RC_GTEST_PROP(LobePropertyTest, MomentsOfAnyMixtureGiveALobeThatHasThem, ()) {
  VmfMoments moments;
  glm::dvec3 sum(0);
  double weight = 0;
  const int count = *rc::gen::inRange(0, 8);
  for (int i = 0; i < count; ++i) {
    const double w = std::pow(10.0, 8.0 * *Unit() - 4);
    const Vmf lobe{*Direction(), *Kappa()};
    const bool cancelled = *rc::gen::arbitrary<bool>();
    for (const float sign : {1.0f, -1.0f}) {
      if (sign < 0 && !cancelled) continue;
      moments.Add(w, {sign * lobe.mu, lobe.kappa});
      sum +=
          w * (1 - double{DeltaFromKappa(lobe.kappa)}) * double{sign} * glm::normalize(glm::dvec3(lobe.mu));
      weight += w;
    }
  }
  const Vmf lobe = moments.Lobe();
  RC_ASSERT(lobe.kappa >= 0 && lobe.kappa <= kMaxKappa);
  RC_ASSERT(std::abs(glm::length(lobe.mu) - 1) < 1e-6f);
  if (weight == 0) return;
  const glm::dvec3 mean = double{MeanCosineFromKappa(lobe.kappa)} * glm::dvec3(lobe.mu);
  RC_ASSERT(glm::distance(mean, sum / weight) < 2e-6);
}

RC_GTEST_PROP(LobePropertyTest, DensitiesAndDistancesAreFiniteForEveryPair, ()) {
  const Vmf a{*Direction(), std::min(*Kappa(), kMaxKappa)}, b{*Direction(), std::min(*Kappa(), kMaxKappa)};
  const float density = VmfPdf(a, b.mu);
  RC_ASSERT(density >= 0 && density <= VmfNormalization(a.kappa) * 1.0001f);
  const float d2 = VmfDistance2(1, a, 1, b);
  RC_ASSERT(std::isfinite(d2) && d2 >= 0);
  // Never further apart than lobes without overlap.
  const float apart = VmfInnerProduct(a, a) + VmfInnerProduct(b, b);
  RC_ASSERT(d2 <= apart * 1.0001f);
  const glm::vec3 s = SampleVmf(a, *Unit(), *Unit());
  RC_ASSERT(std::abs(glm::length(s) - 1) < 1e-6f);
}

/// One floor triangle with one lobe, and a table that has an entry for every vertex and direction.
class LookUp {
 public:
  LookUp() : grid_(0) {
    domain_.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}};
    domain_.normals.assign(3, glm::vec3(0, 1, 0));
    domain_.triangles = {{0, 1, 2}};
    domain_.triangle_double_sided = {0};
    domain_.specular.assign(3, glm::vec3(1));
    domain_.diffuse.assign(3, glm::vec3(0));
    domain_.shape.assign(3, 0);
    domain_.double_sided.assign(3, 0);
    static const BrdfShape shape = FitBrdfShape(BrdfModel::kPhong, 20, {.max_lobes = 1});
    domain_.shapes = {shape};
  }

  /// @param lobe  of (vertex, column)
  template <class Lobe>
  void Fill(const Lobe& lobe) {
    SliceTableBuilder builder(3, grid_.size(), kIndirectEntryBytes);
    std::vector<uint16_t> columns(grid_.size());
    for (uint16_t c = 0; c < columns.size(); ++c) columns[c] = c;
    for (uint32_t v = 0; v < 3; ++v) {
      std::vector<std::byte> entries(columns.size() * kIndirectEntryBytes);
      for (const uint16_t c : columns) EncodeIndirect(lobe(v, c), entries.data() + c * kIndirectEntryBytes);
      builder.AppendRow(columns, entries);
    }
    bytes_ = builder.Finish();
    empty_ = SliceTableBuilder(3, 2, kIndirectEntryBytes).Finish();
    views_.specular = {*SliceTableView::Parse(bytes_)};
    views_.diffuse = *SliceTableView::Parse(empty_);
  }

  /// By the reader of pictures.
  LayerLobes Read(float u, float v, const glm::vec3& wo, TransferPoint* point) const {
    LayerLobes lobes;
    const TransferReader reader(domain_, grid_);
    EXPECT_TRUE(reader.Prepare(0, u, v, wo, point));
    reader.Read(*point, views_, 1, &lobes);
    return lobes;
  }
  /// By the bake's.
  HitLight Gathered(float u, float v, const glm::vec3& wo) const {
    HitLight light;
    const LightQuery query{0, u, v, wo};
    LayerLight(domain_, grid_, views_, 1, 1).Look(std::span(&query, 1), &light);
    return light;
  }

 private:
  BakeDomain domain_;
  DirectionGrid grid_;
  LayerViews views_;
  std::vector<std::byte> bytes_, empty_;
};

RC_GTEST_PROP(LobePropertyTest, LookUpsBetweenAnyLobesKeepTheirLight, ()) {
  LookUp table;
  std::vector<IndirectLobe> lobes;
  const glm::vec3 first = *Direction();
  for (int i = 0; i < 36; ++i) {
    const glm::vec3 mu = *rc::gen::oneOf(rc::gen::just(first), rc::gen::just(-first), Direction());
    lobes.push_back({glm::vec3(*Unit(), *Unit(), *Unit()), mu, *Kappa()});
  }
  table.Fill([&](uint32_t v, uint16_t c) { return lobes[(12 * v + c) % 36]; });
  const float a = *Unit(), b = *Unit(), u = std::min(a, b), v = std::max(a, b) - u;
  glm::vec3 wo = *Direction();
  wo = glm::normalize(glm::vec3(wo.x, std::abs(wo.y) + 1e-4f, wo.z));

  TransferPoint point;
  const LayerLobes read = table.Read(u, v, wo, &point);
  glm::vec3 expected(0), alpha(0), moment(0);
  for (uint32_t k = 0; k < 9; ++k)
    expected += point.corner_weight[k] * lobes[(12 * point.vertex[k / 3] + point.column[k % 3]) % 36].alpha;
  expected *= point.slice.lobe[0].Weight(point.specular);
  RC_ASSERT(read.count <= kMaxGroups);
  for (int i = 0; i < read.count; ++i) {
    const TransferLobe& lobe = read.lobe[i];
    RC_ASSERT(std::abs(glm::length(lobe.mu) - 1) < 1e-5f);
    RC_ASSERT(lobe.kappa >= 0 && lobe.kappa <= kMaxKappa * 1.0001f);
    alpha += lobe.alpha;
    moment += Luminance(lobe.alpha) * MeanCosineFromKappa(lobe.kappa) * lobe.mu;
  }
  RC_ASSERT(glm::distance(alpha, expected) < 2e-3f * glm::length(expected) + 1e-6f);
  const HitLight gathered = table.Gathered(u, v, wo);
  RC_ASSERT(glm::distance(gathered.alpha, expected) < 2e-3f * glm::length(expected) + 1e-6f);
  RC_ASSERT(glm::length(gathered.moment) <= Luminance(gathered.alpha) * 1.001f + 1e-6f);
  RC_ASSERT(glm::length(moment) <= Luminance(alpha) * 1.001f + 1e-6f);
}

TEST(LobeTest, AntipodalLobesAreKeptApartUnlessTheyAreBroad) {
  const glm::vec3 mu = glm::normalize(glm::vec3(0.3f, 0.5f, -0.2f)), wo(0, 1, 0);
  for (const float kappa : {0.0f, 0.3f, 1.0f, 3.0f, 100.0f, kMaxKappa}) {
    LookUp table;
    table.Fill([&](uint32_t v, uint16_t) { return IndirectLobe{glm::vec3(1), v == 0 ? mu : -mu, kappa}; });
    TransferPoint point;
    const LayerLobes lobes = table.Read(0.5f, 0, wo, &point);  // half of vertex 0, half of vertex 1
    glm::dvec3 moment(0);
    for (int i = 0; i < lobes.count; ++i)
      moment += double{lobes.lobe[i].alpha.x} * MeanCosineFromKappa(lobes.lobe[i].kappa) *
                glm::dvec3(lobes.lobe[i].mu);
    const double weight = point.slice.lobe[0].Weight(point.specular).x;
    const std::string name = "antipodal lobes, kappa " + Short(kappa);
    ExpectAtMost(name + ", read as " + Short(lobes.count) + ": first moment left",
                 glm::length(moment) / weight, kappa >= 1 ? 1e-3 : MeanCosineFromKappa(kappa) + 1e-3);
    const HitLight gathered = table.Gathered(0.5f, 0, wo);
    ExpectAtMost(name + ", gathered: first moment left", glm::length(gathered.moment) / weight, 1e-3);
  }
}

/// Of a vMF about `mu` above z = 0 the part that has x > 0; by summing it in rings.
double PartBeyondEdge(const glm::dvec3& mu, double kappa) {
  constexpr int kRings = 96, kSteps = 192;
  const Frame frame = Frame::FromNormal(glm::vec3(mu));
  const glm::dvec3 t(frame.t), b(frame.b);
  double above = 0, beyond = 0;
  const double reach = kappa > 0 ? std::min(2.0, 18 / kappa) : 2;  // of 1 - cosine
  for (int i = 0; i < kRings; ++i) {
    const double w = reach * (i + 0.5) / kRings, s = std::sqrt(w * (2 - w)), density = std::exp(-kappa * w);
    for (int j = 0; j < kSteps; ++j) {
      const double phi = 2 * kPi * (j + 0.5) / kSteps;
      const glm::dvec3 d = (1 - w) * mu + s * (std::cos(phi) * t + std::sin(phi) * b);
      if (d.y <= 0) continue;
      above += density;
      if (d.x > 0) beyond += density;
    }
  }
  return above > 0 ? beyond / above : 0;
}

class LobeMethodTest : public testing::TestWithParam<GatherMethod> {};

// A ceiling over x < 0 whose edge stands over the vertex: the sky is cut along a great circle, so that what
// is free of a lobe is known whatever its kappa. No wider than needed: at 2000 floats do not tell the
// sharpest lobes where it is.
TEST_P(LobeMethodTest, HalfOccludedLobes) {
  for (const float exponent : {0.0f, 1.0f, 8.0f, 32.0f, 128.0f, 512.0f, 2048.0f, 1e4f, 1e5f, 1e6f}) {
    Material material = Glossy(exponent);
    material.diffuse = glm::vec3(0);
    MeshBuilder builder;
    const uint16_t m = builder.AddMaterial(material);
    builder.AddPatch({0, 0, 0}, {1e-3, 0, 0}, {0, 0, -1e-3}, 2, 2, m);
    builder.AddPatch({-40, 1, -40}, {40, 0, 0}, {0, 0, 80}, 2, 2, m);
    const Baked baked(builder.Finish(AnyCamera()), {.method = GetParam(), .grid_level = 2});
    double square = 0, worst = 0;
    int count = 0;
    for (uint32_t c = 0; c < baked.grid().size(); ++c) {
      const glm::vec3 wo = baked.grid().direction(c);
      if (wo.y < 0.05f) continue;
      const BrdfLobe lobe = LookupSlice(baked.domain().shapes[0], wo.y).lobe[0];
      const glm::dvec3 out = glm::normalize(glm::dvec3(wo.x, 0, wo.z) + glm::dvec3(1e-12, 0, 0));
      const glm::dvec3 mu = double{lobe.mu_x} * out + glm::dvec3(0, lobe.mu_z, 0);
      const double error = baked.FreeSpecular(0, c) - PartBeyondEdge(glm::normalize(mu), lobe.kappa);
      square += error * error;
      worst = std::max(worst, std::abs(error));
      ++count;
    }
    const std::string name = "half-occluded lobes, exponent " + Short(exponent) + ", " + NameOf(GetParam());
    const bool shared = GetParam() == GatherMethod::kShared;
    ExpectAtMost(name + ": rms error of the free part", std::sqrt(square / count), shared ? 0.015 : 0.04);
    ExpectAtMost(name + ": worst", worst, shared ? 0.06 : 0.15);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, LobeMethodTest,
                         testing::Values(GatherMethod::kShared, GatherMethod::kPaper),
                         [](const auto& m) { return m.param == GatherMethod::kShared ? "Shared" : "Paper"; });

}  // namespace
}  // namespace glint::stability
