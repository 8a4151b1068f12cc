#include "common/render/view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <string>

#include "common/base/frame.h"

namespace glint {
namespace {

View TestView(int width, int height) {
  View view;
  view.width = width;
  view.height = height;
  view.camera.eye = {1, 2, 3};
  view.camera.forward = {0, 0, -2};  // any length
  view.camera.up = {0.0f, 1.0f, 0.3f};
  view.camera.vertical_fov = 0.8f;
  return view;
}

void ExpectNear(const glm::vec3& a, const glm::vec3& b) { EXPECT_LT(glm::length(a - b), 1e-6f); }

TEST(PrimaryRaysTest, MiddleLooksForwardFromTheEye) {
  const PrimaryRays rays(TestView(640, 480));
  ExpectNear(rays.eye(), {1, 2, 3});
  ExpectNear(rays.Direction(320, 240), {0, 0, -1});
}

TEST(PrimaryRaysTest, RightHandedWithRowZeroOnTop) {
  const PrimaryRays rays(TestView(64, 64));
  EXPECT_GT(rays.Direction(63.5f, 32).x, 0);  // looking along -Z with +Y up, right is +X
  EXPECT_GT(rays.Direction(32, 0.5f).y, 0);
}

TEST(PrimaryRaysTest, FieldOfViewIsVerticalAndPixelsAreSquare) {
  const PrimaryRays rays(TestView(300, 100));
  const glm::vec3 top = rays.Direction(150, 0), left = rays.Direction(0, 50);
  EXPECT_NEAR(std::atan2(top.y, -top.z), 0.4f, 1e-6f);
  EXPECT_NEAR(left.x / left.z, 3 * std::tan(0.4f), 1e-5f);
  const glm::vec3 a = rays.Direction(151, 50), b = rays.Direction(150, 51);
  EXPECT_NEAR(a.x / a.z, -b.y / b.z, 1e-6f);
}

TEST(PrimaryRaysTest, LookingAlongUpStillGivesUnitDirections) {
  View view = TestView(10, 10);
  view.camera.up = view.camera.forward;
  const PrimaryRays rays(view);
  ExpectNear(rays.Direction(5, 5), {0, 0, -1});
  EXPECT_NEAR(glm::length(rays.Direction(0, 0)), 1, 1e-6f);
  EXPECT_NEAR(glm::dot(rays.Direction(0, 5), rays.Direction(5, 5)), std::cos(0.4f), 1e-6f);
}

TEST(PrimaryRaysTest, DirectionsOfAnyLengthServe) {
  for (const float length : {1e-38f, 1e-30f, 1e30f}) {
    View view = TestView(10, 10);
    const PrimaryRays expected(view);
    view.camera.forward *= length;
    view.camera.up *= length;
    const PrimaryRays rays(view);
    ExpectNear(rays.Direction(1, 2), expected.Direction(1, 2));
  }
}

TEST(UnitDirectionTest, IsUnitUnlessThereIsNoDirection) {
  const glm::vec3 diagonal = glm::vec3(1, 1, 0) / std::sqrt(2.0f);
  for (const float length : {1e-45f, 1e-30f, 1.0f, 3e38f}) {
    const auto unit = UnitDirection({length, length, 0});
    ASSERT_TRUE(unit) << length;
    ExpectNear(*unit, diagonal);
  }
  const float infinite = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(UnitDirection({0, 0, 0}));
  EXPECT_FALSE(UnitDirection({0, infinite, 0}));
  EXPECT_FALSE(UnitDirection({1, std::nanf(""), 1}));
}

TEST(CheckViewTest, RefusesWhatCannotBeDrawn) {
  const View good = TestView(64, 48);
  EXPECT_TRUE(CheckView(good).ok());
  const auto refuses = [&](auto change) {
    View view = good;
    change(view);
    const Status status = CheckView(view);
    return status.kind() == ErrorKind::kUsage && !status.message().empty();
  };
  const float nan = std::nanf(""), infinite = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, infinite, -infinite}) {
    EXPECT_TRUE(refuses([&](View& v) { v.camera.eye.y = bad; }));
    EXPECT_TRUE(refuses([&](View& v) { v.camera.forward.z = bad; }));
    EXPECT_TRUE(refuses([&](View& v) { v.camera.up.x = bad; }));
    EXPECT_TRUE(refuses([&](View& v) { v.camera.vertical_fov = bad; }));
    EXPECT_TRUE(refuses([&](View& v) { v.environment_rotation_deg = bad; }));
  }
  EXPECT_TRUE(refuses([](View& v) { v.camera.eye.x = 1e19f; }));
  EXPECT_TRUE(refuses([](View& v) { v.camera.vertical_fov = 0; }));
  EXPECT_TRUE(refuses([](View& v) { v.camera.vertical_fov = kPi; }));
  EXPECT_TRUE(refuses([](View& v) { v.width = 0; }));
  EXPECT_TRUE(refuses([](View& v) { v.height = 32769; }));
}

TEST(CheckViewTest, BoundsThePixelsAsWellAsTheSides) {
  EXPECT_TRUE(CheckView(TestView(32768, 8192)).ok());
  const Status status = CheckView(TestView(32768, 8193));
  EXPECT_EQ(status.kind(), ErrorKind::kUsage);
  EXPECT_NE(status.message().find("268435456 pixels"), std::string::npos);
}

}  // namespace
}  // namespace glint
