#include "worker/visible_parts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <vector>

#include "common/lobes/vmf.h"

namespace glint {
namespace {

using IsVisible = std::function<bool(const glm::vec3&)>;

/// A lobe about +Z seen by even samples, some of which are blocked.
class Lobe {
 public:
  Lobe(float kappa, const IsVisible& visible, int count = 4096) : lobe_{{0, 0, 1}, kappa} {
    const double weight = 1.0 / count;
    for (int i = 0; i < count; ++i) {
      constexpr double kGolden = 0.6180339887498949;
      const double v = i * kGolden;
      const glm::vec3 s =
          SampleVmf({lobe_.mu, kappa}, (static_cast<float>(i) + 0.5f) / static_cast<float>(count),
                    static_cast<float>(v - std::floor(v)));
      if (!visible(s)) continue;
      seen_.push_back(s);
      samples_.Add(glm::vec3(static_cast<float>(weight)), static_cast<float>(weight) * s);
      moments_.mean += weight * glm::dvec3(s);
    }
    moments_.visible = weight * static_cast<double>(seen_.size());
  }

  VisibleParts Split(int most, float tolerance = 0.05f,
                     const GatherKernels& kernels = SelectGatherKernels()) {
    return SplitDirect(
        kernels, moments_, lobe_, {0, most, tolerance},
        [&] {
          return VisibleLight{samples_.List(), samples_.total()};
        },
        [](const glm::dvec3& v) { return v; });
  }

  /// Root mean square of the error under lights of kappa 64 from all around, relative to what is seen.
  double Error(const VisibleParts& parts) const {
    double error = 0, norm = 0;
    const float width = std::sqrt(1 / lobe_.kappa + 1 / 64.0f);
    for (int ring = 0; ring < 8; ++ring)
      for (int i = 0; i < 12; ++i) {
        const float angle = 0.4f * width * (static_cast<float>(ring) + 0.5f),
                    phi = 0.5236f * static_cast<float>(i);
        const Vmf light{{std::sin(angle) * std::cos(phi), std::sin(angle) * std::sin(phi), std::cos(angle)},
                        64};
        double truth = 0, answer = 0;
        for (const glm::vec3& s : seen_) truth += double{VmfPdf(light, s)};
        truth *= moments_.visible / static_cast<double>(seen_.size());
        for (int p = 0; p < parts.count; ++p) {
          const DirectMoments& m = parts.part[p];
          answer += m.visible * double{VmfInnerProduct(LobeOf(m.mean, m.visible, lobe_), light)};
        }
        error += angle * (answer - truth) * (answer - truth);
        norm += angle * truth * truth;
      }
    return std::sqrt(error / norm);
  }
  VisibleParts Whole() const { return {1, {moments_}}; }
  const DirectMoments& moments() const { return moments_; }

 private:
  SliceLobe lobe_;
  std::vector<glm::vec3> seen_;
  LightSamples samples_;
  DirectMoments moments_;
};

/// Parts are ordered, none is empty, and they add up to the whole.
void ExpectSums(const VisibleParts& parts, const DirectMoments& whole) {
  double visible = 0, before = 1;
  glm::dvec3 mean(0);
  for (int i = 0; i < parts.count; ++i) {
    const DirectMoments& part = parts.part[i];
    EXPECT_GT(part.visible, 0);
    EXPECT_LE(part.visible, before + 1e-6);
    EXPECT_LE(glm::length(part.mean), part.visible * (1 + 1e-5));
    before = part.visible;
    visible += part.visible;
    mean += part.mean;
  }
  EXPECT_NEAR(visible, whole.visible, 1e-9);
  EXPECT_LT(glm::distance(mean, whole.mean), 1e-9);
}

IsVisible Beyond(float edge) {
  return [edge](const glm::vec3& s) { return s.x > edge; };
}

TEST(VisiblePartsTest, HalfALobeIsBetterSeenAsSeveral) {
  for (const float kappa : {8.0f, 32.0f, 128.0f}) {
    Lobe half(kappa, Beyond(0));
    const double one = half.Error(half.Whole());
    double before = one;
    for (const int most : {2, 4}) {
      const VisibleParts parts = half.Split(most, 0);
      ASSERT_EQ(parts.count, most) << kappa;
      ExpectSums(parts, half.moments());
      const double error = half.Error(parts);
      std::printf("  kappa %.0f, %d lobes: %.4f, one: %.4f\n", static_cast<double>(kappa), most, error, one);
      EXPECT_LT(error, 0.9 * before) << kappa;
      before = error;
    }
  }
}

TEST(VisiblePartsTest, TwoOpeningsAreTwoLobes) {
  Lobe open(16, [](const glm::vec3& s) { return std::abs(s.x) > 0.25f; });
  const VisibleParts parts = open.Split(2);
  ASSERT_EQ(parts.count, 2);
  ExpectSums(parts, open.moments());
  EXPECT_LT(parts.part[0].mean.x * parts.part[1].mean.x, 0);
  EXPECT_LT(open.Error(parts), 0.7 * open.Error(open.Whole()));
}

TEST(VisiblePartsTest, OneLobeIsKeptWhereItWillDo) {
  EXPECT_EQ(Lobe(32, Beyond(-1)).Split(4).count, 0) << "nothing is blocked";
  EXPECT_EQ(Lobe(32, Beyond(1)).Split(4).count, 0) << "nothing is visible";
  EXPECT_EQ(Lobe(32, Beyond(-0.45f)).Split(4).count, 0) << "hardly anything is blocked";
  EXPECT_EQ(Lobe(32, Beyond(0)).Split(1).count, 0) << "one was asked for";
  int i = 0;
  Lobe dimmed(32, [&](const glm::vec3&) { return ++i % 2 == 0; });
  EXPECT_EQ(dimmed.Split(4, 0.2f).count, 0) << "blocked evenly";
}

TEST(VisiblePartsTest, NoMoreLobesThanTheToleranceAsksFor) {
  int before = 5;
  for (const float tolerance : {0.0f, 0.2f, 1.0f, 5.0f}) {
    const int count = std::max(Lobe(32, Beyond(0)).Split(4, tolerance).count, 1);
    EXPECT_LE(count, before) << tolerance;
    before = count;
  }
  EXPECT_EQ(before, 1);
}

TEST(VisiblePartsTest, EveryInstructionSetFindsTheSame) {
  Lobe half(32, Beyond(0.02f));
  const VisibleParts base = half.Split(3, 0, kGatherKernelsBase), best = half.Split(3, 0);
  ASSERT_EQ(base.count, best.count);
  for (int i = 0; i < base.count; ++i) {
    EXPECT_NEAR(base.part[i].visible, best.part[i].visible, 1e-3);
    EXPECT_LT(glm::distance(base.part[i].mean, best.part[i].mean), 1e-3);
  }
}

TEST(VisiblePartsTest, FewSamplesAreNoTrouble) {
  for (int count = 1; count < 24; ++count)
    for (const float edge : {-0.2f, 0.0f, 0.2f}) {
      Lobe lobe(32, Beyond(edge), count);
      const VisibleParts parts = lobe.Split(4, 0);
      if (parts.count > 0) ExpectSums(parts, lobe.moments());
    }
}

}  // namespace
}  // namespace glint
