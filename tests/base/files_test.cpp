#include "common/base/files.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <string>
#include <thread>

#include "tests/base/process.h"
#include "tests/base/temp_folder.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

std::span<const std::byte> BytesOf(std::string_view s) { return std::as_bytes(std::span(s)); }

std::string TextOf(const fs::path& path) {
  const auto bytes = ReadFile(path, 1 << 24);
  if (!bytes.ok()) return "(" + bytes.status().message() + ")";
  return {reinterpret_cast<const char*>(bytes->data()), bytes->size()};
}

TEST(PublishFileTest, WritesAndReplaces) {
  const TempFolder folder;
  const fs::path path = folder / "file";
  ASSERT_TRUE(PublishFile(path, BytesOf("old")).ok());
  EXPECT_EQ(TextOf(path), "old");
  ASSERT_TRUE(PublishFile(path, BytesOf("new content")).ok());
  EXPECT_EQ(TextOf(path), "new content");
  ASSERT_TRUE(PublishFile(path, {}).ok());
  EXPECT_EQ(TextOf(path), "");
  EXPECT_EQ(folder.FileCount(), 1u);
}

TEST(PublishFileTest, FailuresNameThePathAndLeaveNothing) {
  const TempFolder folder;
  const Status missing = PublishFile(folder / "absent/file", BytesOf("x"));
  EXPECT_EQ(missing.kind(), ErrorKind::kIo);
  EXPECT_NE(missing.message().find("absent/file"), std::string::npos) << missing.message();

  fs::create_directories(folder / "taken/by a folder");
  EXPECT_EQ(PublishFile(folder / "taken", BytesOf("x")).kind(), ErrorKind::kIo);
  EXPECT_EQ(PublishFile("", BytesOf("x")).kind(), ErrorKind::kIo);
  EXPECT_EQ(folder.FileCount(), 0u);
}

TEST(PublishFileTest, ReadersSeeWholeFilesOnly) {
  const TempFolder folder;
  const fs::path path = folder / "file";
  constexpr size_t kBytes = 1 << 18;
  ASSERT_TRUE(PublishFile(path, BytesOf(std::string(kBytes, 'a'))).ok());

  std::atomic<bool> done{false};
  std::atomic<int> torn{0}, reads{0};
  std::jthread reader([&] {
    while (!done || reads == 0) {
      const std::string text = TextOf(path);
      if (text.size() != kBytes || std::count(text.begin(), text.end(), text[0]) != static_cast<int>(kBytes))
        ++torn;
      ++reads;
    }
  });
  std::vector<std::jthread> writers;
  std::atomic<int> failures{0};
  for (const char letter : {'b', 'c'}) {
    writers.emplace_back([&, letter] {
      for (int i = 0; i < 20; ++i) failures += !PublishFile(path, BytesOf(std::string(kBytes, letter))).ok();
    });
  }
  writers.clear();  // joins
  done = true;
  reader.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(failures, 0);
  EXPECT_EQ(folder.FileCount(), 1u);
}

struct CrashCase {
  const char* point;
  const char* content_after;
};

class PublishCrashTest : public testing::TestWithParam<CrashCase> {};

TEST_P(PublishCrashTest, LeavesTheOldOrTheNewFile) {
  const TempFolder folder;
  const fs::path path = folder / "file";
  ASSERT_TRUE(PublishFile(path, BytesOf("old")).ok());

  const std::string crash_at = "GLINT_CRASH_AT=" + std::string(GetParam().point) + ":";
  const std::vector<std::string> command{GLINT_BASE_PROBE, "publish", path.string(), "new"};
  EXPECT_EQ(RunProcess(command, {crash_at + "1"}).signal, SIGKILL);
  EXPECT_EQ(TextOf(path), GetParam().content_after);
  // The second passing is never reached; and what the killed process left does not stand in the way.
  EXPECT_EQ(RunProcess(command, {crash_at + "2"}).exit_code, 0);
  EXPECT_EQ(TextOf(path), "new");
}

INSTANTIATE_TEST_SUITE_P(AtEveryPoint, PublishCrashTest,
                         testing::Values(CrashCase{"before-write", "old"}, CrashCase{"after-write", "old"},
                                         CrashCase{"before-rename", "old"}, CrashCase{"after-rename", "new"},
                                         CrashCase{"after-dir-fsync", "new"}),
                         [](const auto& crash) {
                           std::string name = crash.param.point;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST(CrashPointTest, MalformedPlansDoNothing) {
  const TempFolder folder;
  const std::vector<std::string> command{GLINT_BASE_PROBE, "publish", (folder / "file").string(), "new"};
  for (const char* plan :
       {"", "before-write", "before-write:", "before-write:0", "before-write:-1", "other:1", ":"}) {
    EXPECT_EQ(RunProcess(command, {std::string("GLINT_CRASH_AT=") + plan}).exit_code, 0) << plan;
  }
}

TEST(FilePublisherTest, PiecesBecomeOneFile) {
  const TempFolder folder;
  auto publisher = FilePublisher::Create(folder / "file");
  ASSERT_TRUE(publisher.ok());
  ASSERT_TRUE(publisher->Write(BytesOf("one ")).ok());
  EXPECT_EQ(publisher->offset(), 4u);
  FilePublisher moved = std::move(*publisher);
  ASSERT_TRUE(moved.Write(BytesOf("two")).ok());
  EXPECT_FALSE(fs::exists(folder / "file"));
  ASSERT_TRUE(moved.Commit().ok());
  EXPECT_EQ(TextOf(folder / "file"), "one two");
}

TEST(FilePublisherTest, WithoutCommitNothingStays) {
  const TempFolder folder;
  {
    auto publisher = FilePublisher::Create(folder / "file");
    ASSERT_TRUE(publisher.ok());
    ASSERT_TRUE(publisher->Write(BytesOf("text")).ok());
  }
  EXPECT_EQ(folder.FileCount(), 0u);
}

size_t EntryCount(const fs::path& folder) {
  return static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(FilePublisherTest, WhatKilledProcessesLeftGoesWithTheNextFileOfThatName) {
  const TempFolder folder;
  const fs::path path = folder / "file", other = folder / "file.json";
  for (const fs::path& name : {path, path, other}) {
    EXPECT_EQ(
        RunProcess({GLINT_BASE_PROBE, "publish", name.string(), "new"}, {"GLINT_CRASH_AT=after-write:1"})
            .signal,
        SIGKILL);
  }
  std::ofstream(folder / ".file.1.2.txt") << "not ours";
  std::ofstream(folder / ".file.x.2.tmp") << "not ours";
  auto alive = FilePublisher::Create(path);  // removes two
  ASSERT_TRUE(alive.ok());
  EXPECT_EQ(EntryCount(folder.path()), 4u);
  ASSERT_TRUE(PublishFile(path, BytesOf("by another")).ok());
  EXPECT_EQ(EntryCount(folder.path()), 5u) << "one that is being written stays";
  ASSERT_TRUE(alive->Write(BytesOf("whole")).ok());
  ASSERT_TRUE(alive->Commit().ok());
  EXPECT_EQ(TextOf(path), "whole");
  EXPECT_EQ(EntryCount(folder.path()), 4u);
}

TEST(CheckPublishableTest, TriesAndLeavesNothing) {
  const TempFolder folder;
  EXPECT_TRUE(CheckPublishable(folder / "file").ok());
  std::ofstream(folder / "file") << "old";
  EXPECT_TRUE(CheckPublishable(folder / "file").ok());
  EXPECT_EQ(TextOf(folder / "file"), "old");
  EXPECT_EQ(EntryCount(folder.path()), 1u);
  EXPECT_EQ(CheckPublishable(folder.path()).kind(), ErrorKind::kUsage);
  EXPECT_EQ(CheckPublishable(folder.path() / "").kind(), ErrorKind::kUsage);
  EXPECT_EQ(CheckPublishable(folder / "absent/file").kind(), ErrorKind::kUsage);
  EXPECT_EQ(CheckPublishable(folder / "file/below").kind(), ErrorKind::kUsage);
  const std::string long_name(300, 'x');
  EXPECT_EQ(CheckPublishable(folder / long_name).kind(), ErrorKind::kIo);
}

TEST(CreateFoldersTest, MakesWhatIsMissing) {
  const TempFolder folder;
  ASSERT_TRUE(CreateFolders(folder / "a/b/c").ok());
  ASSERT_TRUE(CreateFolders(folder / "a/b/c").ok());
  ASSERT_TRUE(CreateFolders((folder / "a/d").string() + "/").ok());
  EXPECT_TRUE(fs::is_directory(folder / "a/b/c"));
  EXPECT_TRUE(fs::is_directory(folder / "a/d"));
  std::ofstream(folder / "file") << "x";
  EXPECT_EQ(CreateFolders(folder / "file").kind(), ErrorKind::kIo);
  EXPECT_EQ(CreateFolders(folder / "file/below").kind(), ErrorKind::kIo);
}

TEST(ReadFileTest, RefusesWhatItShould) {
  const TempFolder folder;
  std::ofstream(folder / "file") << "12345";
  EXPECT_EQ(ReadFile(folder / "file", 5)->size(), 5u);
  EXPECT_EQ(ReadFile(folder / "file", 4).status().kind(), ErrorKind::kLimit);
  EXPECT_EQ(ReadFile(folder / "absent", 5).status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(ReadFile(folder.path(), 5).status().kind(), ErrorKind::kBadInput);
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(ReadFile(folder / "pipe", 5).status().kind(), ErrorKind::kBadInput);
}

TEST(MappedFileTest, ShowsTheFile) {
  const TempFolder folder;
  std::ofstream(folder / "file") << "12345";
  std::ofstream(folder / "empty");
  auto mapped = MappedFile::Open(folder / "file");
  ASSERT_TRUE(mapped.ok());
  MappedFile moved = std::move(*mapped);
  EXPECT_TRUE(mapped->bytes().empty());
  ASSERT_EQ(moved.bytes().size(), 5u);
  EXPECT_EQ(moved.bytes()[4], std::byte{'5'});
  // A mapping outlives the file's name.
  fs::remove(folder / "file");
  EXPECT_EQ(moved.bytes()[0], std::byte{'1'});
  moved = MappedFile();
  EXPECT_TRUE(moved.bytes().empty());

  EXPECT_TRUE(MappedFile::Open(folder / "empty")->bytes().empty());
  EXPECT_EQ(MappedFile::Open(folder / "absent").status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(MappedFile::Open(folder.path()).status().kind(), ErrorKind::kBadInput);
}

}  // namespace
}  // namespace glint
