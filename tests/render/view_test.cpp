#include "common/render/view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

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

}  // namespace
}  // namespace glint
