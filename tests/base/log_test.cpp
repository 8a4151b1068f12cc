#include "common/base/log.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <sstream>

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

TEST(LogTest, WritesObjectsForPrograms) {
  testing::internal::CaptureStderr();
  SetLogFormat(LogFormat::kJson);
  Log(LogLevel::kWarning, "a \"quote\"\nand \xff", {{"bake", "0123"}, {"task", "7"}});
  Log(LogLevel::kProgress, "layer 1");
  SetLogFormat(LogFormat::kText);
  std::istringstream lines(testing::internal::GetCapturedStderr());
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  const nlohmann::json warning = nlohmann::json::parse(line);
  EXPECT_EQ(warning["level"], "warning");
  EXPECT_EQ(warning["message"], "a \"quote\"\nand \xef\xbf\xbd");
  EXPECT_EQ(warning["bake"], "0123");
  EXPECT_EQ(warning["task"], "7");
  const std::string time = warning["time"];
  ASSERT_EQ(time.size(), std::string("2026-01-02T03:04:05.678Z").size()) << time;
  EXPECT_EQ(time.back(), 'Z');
  ASSERT_TRUE(std::getline(lines, line));
  EXPECT_EQ(nlohmann::json::parse(line)["level"], "progress");
  EXPECT_FALSE(std::getline(lines, line));
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
