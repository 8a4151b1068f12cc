// The unit of length and the place of the origin are the file's matter: results must not depend on them.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/archive/lobe_codec.h"
#include "common/base/frame.h"
#include "common/render/reference.h"
#include "tests/stability/stability_fixture.h"

namespace glint::stability {
namespace {

/// A floor, a box and a ball above it, all in co-ordinates of few bits, so that moving them by powers of two
/// is exact; times `scale`, then moved by `offset`.
Scene Placed(double scale, double offset) {
  MeshBuilder builder;
  const uint16_t material = builder.AddMaterial(Glossy());
  builder.AddPatch({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 6, 6, material);
  AddBox({-0.75, 0.125, -0.5}, {-0.25, 0.75, 0.25}, 3, false, material, &builder);
  builder.AddStarShape(
      2, [](const glm::dvec3& d) { return glm::dvec3(0.375, 0.5, 0.25) + 0.375 * d; }, material);
  Scene scene = builder.Finish(AnyCamera());
  for (glm::vec3& p : scene.positions)
    p = glm::vec3(glm::round(glm::dvec3(p) * 256.0) / 256.0 * scale +
                  glm::dvec3(offset, -offset, 0.5 * offset));
  scene.content = HashScene(scene);
  return scene;
}

/// How the slices of two bakes of one scene differ, over all vertices and directions.
struct Difference {
  double direct = 0, indirect = 0;  ///< rms of free parts; of reflected luminance
  uint64_t entries = 0;             ///< stored ones that are not the same bytes
};

class Comparison {
 public:
  Comparison(const Baked& a, const Baked& b) : a_(a.archive().layers()), b_(b.archive().layers()) {
    for (uint32_t v = 0; v < a.domain().vertex_count(); ++v) {
      for (int layer = 0; layer < a.layers(); ++layer) {
        const auto l = static_cast<size_t>(layer);
        Compare(a_[l].diffuse, b_[l].diffuse, v, 0, layer);
        for (uint32_t c = 0; c < a.grid().size(); ++c)
          if (a.Defined(v, c)) Compare(a_[l].specular[0], b_[l].specular[0], v, c, layer);
      }
    }
    result_.direct = std::sqrt(square_[0] / count_[0]);
    result_.indirect = std::sqrt(square_[1] / count_[1]);
  }
  const Difference& result() const { return result_; }

 private:
  static double Value(const std::byte* entry, uint32_t bytes, int layer) {
    if (layer == 0) return entry ? DecodeDirect(entry, bytes).fraction : 1;
    return entry ? Luminance(DecodeIndirect(entry, bytes).alpha) : 0;
  }
  void Compare(const SliceTableView& a, const SliceTableView& b, uint32_t row, uint32_t column, int layer) {
    const std::byte *x = a.Find(row, column), *y = b.Find(row, column);
    const uint32_t bytes = a.entry_bytes();
    const int kind = layer > 0;
    const double difference = Value(x, bytes, layer) - Value(y, b.entry_bytes(), layer);
    square_[kind] += difference * difference;
    count_[kind] += 1;
    const bool alike = (x == nullptr) == (y == nullptr) && bytes == b.entry_bytes();
    result_.entries += !alike || (x && std::memcmp(x, y, bytes) != 0);
  }

  const std::vector<LayerViews>&a_, &b_;
  double square_[2] = {}, count_[2] = {};
  Difference result_;
};

class ScaleTest : public testing::TestWithParam<GatherMethod> {
 protected:
  SmallBake Options() const { return {.method = GetParam(), .layers = 1, .rays = 512}; }
  std::string Named(const std::string& what) const { return what + ", " + NameOf(GetParam()); }
};

TEST_P(ScaleTest, PowersOfTwoGiveTheSameBytes) {
  const Baked unit(Placed(1, 0), Options());
  for (const int power : {-40, -20, -10, 10, 20, 40}) {
    const Baked scaled(Placed(std::exp2(power), 0), Options());
    ExpectAtMost(Named("scale 2^" + Short(power) + ": entries of other bytes"),
                 static_cast<double>(Comparison(unit, scaled).result().entries), 0);
  }
}

TEST_P(ScaleTest, AnyUnitGivesTheSameSlices) {
  const Baked unit(Placed(1, 0), Options());
  for (const double scale : {1e-12, 1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9, 1e12}) {
    const Baked scaled(Placed(scale, 0), Options());
    const Difference difference = Comparison(unit, scaled).result();
    ExpectAtMost(Named("scale " + Short(scale) + ": rms change of free parts"), difference.direct, 0.01);
    ExpectAtMost(Named("scale " + Short(scale) + ": rms change of indirect light"), difference.indirect,
                 0.01);
  }
}

// Away from the origin floats resolve less: at n times the scene's size n * 2^-24 of it, and rays start
// 2^-19 n of it above the surface.
TEST_P(ScaleTest, FarFromTheOriginSlicesChangeWithTheResolutionOfFloats) {
  const Baked unit(Placed(1, 0), Options());
  for (const int power : {0, 4, 8, 10, 12, 14}) {
    const double offset = std::exp2(power);
    const Baked moved(Placed(1, offset), Options());
    const Difference difference = Comparison(unit, moved).result();
    const double bound = 0.01 + offset * 0x1p-18;
    ExpectAtMost(Named("offset " + Short(offset) + ": rms change of free parts"), difference.direct, bound);
    ExpectAtMost(Named("offset " + Short(offset) + ": rms change of indirect light"), difference.indirect,
                 bound);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, ScaleTest, testing::Values(GatherMethod::kShared, GatherMethod::kPaper),
                         [](const auto& m) { return m.param == GatherMethod::kShared ? "Shared" : "Paper"; });

TEST(ScaleReferenceTest, ThePathTracerSeesTheSamePictureInAnyUnit) {
  Result<Environment> sky = Environment::Procedural("sunset", 32);
  ASSERT_TRUE(sky.ok());
  std::vector<double> mean;
  for (const double scale : {1.0, 1e-12, 1e-6, 1e6, 1e12}) {
    const Scene scene = Placed(scale, 0);
    const RayScene rays(scene);
    View view;
    view.camera.eye = static_cast<float>(scale) * glm::vec3(0.5f, 2, 3);
    view.camera.forward = glm::normalize(glm::vec3(-0.2f, -0.6f, -1));
    view.width = view.height = 24;
    ReferenceOptions options;
    options.bounces = 1;
    options.samples = 32;
    options.threads = 1;
    Result<ReferenceResult> result = RenderReference(scene, rays, nullptr, *sky, view, options);
    ASSERT_TRUE(result.ok());
    double sum = 0;
    for (const glm::vec4& pixel : result->picture.pixels) sum += Luminance(glm::vec3(pixel));
    mean.push_back(sum / static_cast<double>(result->picture.pixels.size()));
    ExpectAtMost("reference, scale " + Short(scale) + ": relative change of the picture's mean",
                 std::abs(mean.back() / mean[0] - 1), 0.005);
  }
}

}  // namespace
}  // namespace glint::stability
