#include "common/base/status.h"

#include <gtest/gtest.h>

#include <memory>

namespace glint {
namespace {

Result<int> Half(int n) {
  if (n % 2 != 0) return BadInput("odd");
  return n / 2;
}

Result<int> Quarter(int n) {
  GLINT_ASSIGN_OR_RETURN(const int half, Half(n));
  GLINT_ASSIGN_OR_RETURN(const int quarter, Half(half));
  return quarter;
}

TEST(StatusTest, IsOkByDefault) {
  EXPECT_TRUE(Status().ok());
  EXPECT_TRUE(Status().WithContext("file").ok());
}

TEST(StatusTest, ContextComesFirst) {
  const Status status = LimitExceeded("too large").WithContext("scene.glb");
  EXPECT_EQ(status.kind(), ErrorKind::kLimit);
  EXPECT_EQ(status.message(), "scene.glb: too large");
}

TEST(ResultTest, HandsValuesAndErrorsOn) {
  EXPECT_EQ(*Quarter(12), 3);
  EXPECT_EQ(Quarter(6).status().message(), "odd");
  EXPECT_EQ(Quarter(5).status().kind(), ErrorKind::kBadInput);
}

TEST(ResultTest, HoldsWhatCanOnlyBeMoved) {
  Result<std::unique_ptr<int>> result(std::make_unique<int>(4));
  const std::unique_ptr<int> value = std::move(result).value();
  EXPECT_EQ(*value, 4);
}

// Scripts rely on these numbers (docs/cli.md).
TEST(ErrorKindTest, NumbersAreTheExitCodes) {
  EXPECT_EQ(static_cast<int>(ErrorKind::kOk), 0);
  EXPECT_EQ(static_cast<int>(ErrorKind::kInternal), 1);
  EXPECT_EQ(static_cast<int>(ErrorKind::kUsage), 2);
  EXPECT_EQ(static_cast<int>(ErrorKind::kBadInput), 3);
  EXPECT_EQ(static_cast<int>(ErrorKind::kLimit), 4);
  EXPECT_EQ(static_cast<int>(ErrorKind::kInterrupted), 5);
  EXPECT_EQ(static_cast<int>(ErrorKind::kIo), 6);
  EXPECT_EQ(static_cast<int>(ErrorKind::kMismatch), 7);
}

}  // namespace
}  // namespace glint
