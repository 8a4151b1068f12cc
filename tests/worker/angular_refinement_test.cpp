#include "worker/angular_refinement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <set>

#include "common/archive/lobe_codec.h"
#include "common/archive/nested.h"
#include "worker/slice_encoder.h"

namespace glint {
namespace {

constexpr uint32_t kAll = 1u << 16;

/// One vertex facing +Z whose direct slices are a function of the direction.
class AngularRefinementTest : public testing::Test {
 protected:
  AngularRefinementTest() : grid_(4, 1) {}

  /// Smooth above y = 0; below, free.
  static float Smooth(const glm::vec3& d) { return d.y > 0 ? 1 - 0.6f * d.y * d.y : 1; }
  /// Blocked on one side of a plane.
  static float Edge(const glm::vec3& d) { return d.x > 0.1f ? 0.25f : 1; }

  RefinedSide Side(float (*fraction)(const glm::vec3&), int everywhere = 1) {
    return {{0, 0, 1}, 1, everywhere, 100, [this, fraction](uint32_t direction, BlockResult* out) {
              ++computed_;
              const float part = fraction(grid_.direction(direction));
              if (part < 1)
                StoreDirect(DirectLobe{.fraction = part}, static_cast<uint16_t>(direction), &out->slots[0]);
            }};
  }

  BlockResult Refine(const RefinedSide& side, float tolerance) {
    AngularRefinement refinement(grid_, {1, 1}, true, tolerance);
    refinement.Begin();
    refinement.Refine(side);
    return Store(&refinement, {0, 1, 0, kAll});
  }

  static BlockResult Store(AngularRefinement* refinement, const GatherBlock& block) {
    BlockResult result;
    result.slots.resize(2);
    result.slots[0].BeginRow();
    result.counters.slices = refinement->Store(block, &result);
    return result;
  }

  /// What is read at a direction of the grid's.
  float Read(const BlockResult& result, uint32_t triangle, int corner) const {
    std::array<float, 3> weight{};
    weight[corner] = 1;
    const BlockRows& rows = result.slots[0];
    std::map<uint32_t, const std::byte*> stored;
    for (size_t i = 0; i < rows.columns.size(); ++i)
      stored[rows.columns[i]] = rows.entries.data() + i * kDirectEntryBytes;
    float sum = 0;
    VisitStandIns(
        grid_, grid_.level(), triangle, weight, [&](uint32_t d) { return grid_.direction(d).z > 0; },
        [&](uint32_t d) {
          const auto found = stored.find(d);
          return found == stored.end() ? nullptr : found->second;
        },
        [&](uint32_t, float w, const std::byte* entry) {
          sum += w * (entry ? DecodeDirect(entry).fraction : 1.0f);
        });
    return sum;
  }

  const DirectionGrid grid_;
  int computed_ = 0;
};

TEST_F(AngularRefinementTest, WithoutToleranceEveryDirectionThatDiffersIsStored) {
  const BlockResult result = Refine(Side(Smooth, grid_.level()), 0);
  for (uint32_t t = 0; t < grid_.triangles().size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const glm::vec3& d = grid_.direction(grid_.triangles()[t][i]);
      if (d.z > 0) {
        ASSERT_NEAR(Read(result, t, i), Smooth(d), 1e-4);
      }
    }
}

TEST_F(AngularRefinementTest, SmoothSlicesAreFewAndRightWithinTheTolerance) {
  constexpr float kTolerance = 0.02f;
  const BlockResult result = Refine(Side(Smooth), kTolerance);
  EXPECT_LT(computed_, 1000);  // of some 1280 above the horizon
  EXPECT_LT(result.slots[0].columns.size(), 200u);
  for (uint32_t t = 0; t < grid_.triangles().size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const glm::vec3& d = grid_.direction(grid_.triangles()[t][i]);
      if (d.z > 0) {
        ASSERT_NEAR(Read(result, t, i), Smooth(d), 3 * kTolerance);
      }
    }
}

TEST_F(AngularRefinementTest, AnEdgeIsFollowedToTheFinestLevel) {
  const BlockResult result = Refine(Side(Edge), 0.1f);
  EXPECT_LT(computed_, 900);
  std::set<uint32_t> wrong;
  for (uint32_t t = 0; t < grid_.triangles().size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const uint32_t direction = grid_.triangles()[t][i];
      const glm::vec3& d = grid_.direction(direction);
      if (d.z <= 0 || std::abs(Read(result, t, i) - Edge(d)) <= 0.2f) continue;
      wrong.insert(direction);
      EXPECT_LT(std::abs(d.x - 0.1f), 0.07f) << "more than a cell from the edge";
    }
  // Where the edge bends into a triangle between corners that are all as predicted, nothing tells of it.
  EXPECT_LE(wrong.size(), 6u);
}

/// Beyond the base level nothing stands for a free slice but an entry that says so.
TEST_F(AngularRefinementTest, FreeSlicesBesideBlockedOnesAreStored) {
  const BlockResult result = Refine(Side(Edge), 0.1f);
  const BlockRows& rows = result.slots[0];
  int free = 0;
  for (size_t i = 0; i < rows.columns.size(); ++i) {
    const DirectLobe lobe = DecodeDirect(rows.entries.data() + i * kDirectEntryBytes);
    if (lobe.fraction < 1) continue;
    ++free;
    EXPECT_GE(rows.columns[i], DirectionGrid::SizeOf(grid_.base_level()));
    EXPECT_EQ(lobe.kappa_ratio, 1);
  }
  EXPECT_GT(free, 5);
}

TEST_F(AngularRefinementTest, BlocksOfDirectionsShareOneResult) {
  AngularRefinement refinement(grid_, {1, 1}, true, 0.05f);
  refinement.Begin();
  refinement.Refine(Side(Smooth));  // a vertex before, to be forgotten
  refinement.Begin();
  refinement.Refine(Side(Edge));
  const BlockResult whole = Store(&refinement, {0, 1, 0, kAll});
  EXPECT_EQ(whole.slots[0].columns, Refine(Side(Edge), 0.05f).slots[0].columns);
  BlockRows joined;
  uint64_t computed = 0;
  for (uint32_t first = 0; first < grid_.size(); first += 100) {
    const BlockResult part = Store(&refinement, {0, 1, first, 100});
    computed += part.counters.slices;
    const BlockRows& rows = part.slots[0];
    joined.columns.insert(joined.columns.end(), rows.columns.begin(), rows.columns.end());
    joined.entries.insert(joined.entries.end(), rows.entries.begin(), rows.entries.end());
  }
  EXPECT_EQ(joined.columns, whole.slots[0].columns);
  EXPECT_EQ(joined.entries, whole.slots[0].entries);
  EXPECT_EQ(computed, whole.counters.slices);
}

}  // namespace
}  // namespace glint
