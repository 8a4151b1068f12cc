#include "common/base/log.h"

#include <gtest/gtest.h>
#include <signal.h>

#include "tests/base/process.h"

namespace glint {
namespace {

TEST(LogTest, WritesOnlyWhatTheLevelAllows) {
  testing::internal::CaptureStderr();
  Log(LogLevel::kNote, "first");
  SetLogLevel(LogLevel::kError);
  Log(LogLevel::kWarning, "second");
  Log(LogLevel::kError, "third");
  SetLogLevel(LogLevel::kProgress);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "note: first\nerror: third\n");
}

TEST(StopTest, IsRememberedUntilCleared) {
  ClearStop();
  EXPECT_FALSE(StopRequested());
  RequestStop();
  EXPECT_TRUE(StopRequested());
  ClearStop();
  EXPECT_FALSE(StopRequested());
}

TEST(StopTest, TheFirstSignalAsks) { EXPECT_EQ(RunProcess({GLINT_BASE_PROBE, "stop", "1"}).exit_code, 0); }

TEST(StopTest, TheSecondSignalEndsTheProcess) {
  EXPECT_EQ(RunProcess({GLINT_BASE_PROBE, "stop", "2"}).signal, SIGTERM);
}

TEST(StopTest, NothingIsSeenWithoutASignal) {
  EXPECT_EQ(RunProcess({GLINT_BASE_PROBE, "stop", "0"}).exit_code, 1);
}

}  // namespace
}  // namespace glint
