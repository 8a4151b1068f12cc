#include "common/store/store.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>
#include <thread>

#include "tests/base/temp_folder.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

std::vector<std::byte> BytesOf(std::string_view s) {
  const auto bytes = std::as_bytes(std::span(s));
  return {bytes.begin(), bytes.end()};
}

Digest Key(std::string_view name) { return Hasher().String(name).Finish(); }

fs::path PathOf(const ChunkStore& store, const char* kind, const Digest& digest) {
  return store.root() / kind / digest.Hex().substr(0, 2) / digest.Hex();
}

std::string ReadText(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}
void WriteText(const fs::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
}

class ChunkStoreTest : public testing::Test {
 protected:
  TempFolder folder_;
  ChunkStore store_ = *ChunkStore::Open(folder_ / "work/store");
};

TEST_F(ChunkStoreTest, RoundTrip) {
  EXPECT_EQ(store_.FindResult(Key("task")), std::nullopt);
  for (const std::string& text : {std::string(), std::string("payload"), std::string(100000, 'x')}) {
    const std::vector<std::byte> payload = BytesOf(text);
    const Digest digest = *store_.PutResult(Key(text), payload);
    EXPECT_EQ(digest, Sha256(payload));
    EXPECT_EQ(store_.FindResult(Key(text)), digest);
    EXPECT_EQ(*store_.Get(digest), payload);
  }
  // A later process sees the same.
  const ChunkStore again = *ChunkStore::Open(store_.root());
  EXPECT_EQ(*again.Get(*again.FindResult(Key("payload"))), BytesOf("payload"));
}

TEST_F(ChunkStoreTest, TasksWithOneResultShareAChunk) {
  const Digest digest = *store_.PutResult(Key("a"), BytesOf("same"));
  EXPECT_EQ(*store_.PutResult(Key("b"), BytesOf("same")), digest);
  EXPECT_EQ(*store_.PutResult(Key("b"), BytesOf("same")), digest);
  EXPECT_EQ(folder_.FileCount(), 3u);  // a chunk and two records
}

TEST_F(ChunkStoreTest, NoticesTruncationAtEveryByte) {
  const Digest digest = *store_.PutResult(Key("task"), BytesOf("some payload"));
  const fs::path path = PathOf(store_, "chunks", digest);
  const std::string whole = ReadText(path);
  ASSERT_EQ(whole.size(), 32u + 12u);
  for (size_t size = 0; size < whole.size(); ++size) {
    WriteText(path, whole.substr(0, size));
    const Status status = store_.Get(digest).status();
    ASSERT_EQ(status.kind(), ErrorKind::kBadInput) << size << " bytes";
    ASSERT_NE(status.message().find(path.string()), std::string::npos) << status.message();
  }
  WriteText(path, whole + '\0');
  EXPECT_EQ(store_.Get(digest).status().kind(), ErrorKind::kBadInput);
  WriteText(path, whole);
  EXPECT_TRUE(store_.Get(digest).ok());
}

TEST_F(ChunkStoreTest, NoticesEveryFlippedBit) {
  const Digest digest = *store_.PutResult(Key("task"), BytesOf("some payload"));
  const fs::path path = PathOf(store_, "chunks", digest);
  const std::string whole = ReadText(path);
  for (size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::string damaged = whole;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    WriteText(path, damaged);
    ASSERT_EQ(store_.Get(digest).status().kind(), ErrorKind::kBadInput) << "bit " << bit;
  }
}

TEST_F(ChunkStoreTest, NoticesASoundChunkUnderAnotherName) {
  const Digest a = *store_.PutResult(Key("a"), BytesOf("content a"));
  const Digest b = *store_.PutResult(Key("b"), BytesOf("content b"));
  WriteText(PathOf(store_, "chunks", a), ReadText(PathOf(store_, "chunks", b)));
  EXPECT_EQ(store_.Get(a).status().kind(), ErrorKind::kBadInput);
}

TEST_F(ChunkStoreTest, ARecordWithoutItsChunkIsNoResult) {
  const Digest digest = *store_.PutResult(Key("task"), BytesOf("payload"));
  fs::remove(PathOf(store_, "chunks", digest));
  EXPECT_EQ(store_.FindResult(Key("task")), std::nullopt);
  EXPECT_EQ(store_.Get(digest).status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(*store_.PutResult(Key("task"), BytesOf("payload")), digest);
  EXPECT_EQ(store_.FindResult(Key("task")), digest);
}

TEST_F(ChunkStoreTest, ADamagedRecordIsNoResult) {
  ASSERT_TRUE(store_.PutResult(Key("task"), BytesOf("payload")).ok());
  const fs::path path = PathOf(store_, "tasks", Key("task"));
  const std::string whole = ReadText(path);
  for (size_t size = 0; size < whole.size(); ++size) {
    WriteText(path, whole.substr(0, size));
    ASSERT_EQ(store_.FindResult(Key("task")), std::nullopt) << size << " bytes";
  }
  for (size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::string damaged = whole;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    WriteText(path, damaged);
    ASSERT_EQ(store_.FindResult(Key("task")), std::nullopt) << "bit " << bit;
  }
}

TEST_F(ChunkStoreTest, DiscardMakesTheTaskUnfinished) {
  const Digest digest = *store_.PutResult(Key("task"), BytesOf("payload"));
  WriteText(PathOf(store_, "chunks", digest), "damaged");
  ASSERT_TRUE(store_.Discard(Key("task"), digest).ok());
  EXPECT_EQ(store_.FindResult(Key("task")), std::nullopt);
  EXPECT_EQ(folder_.FileCount(), 0u);
  EXPECT_TRUE(store_.Discard(Key("task"), digest).ok()) << "again: nothing to do";
}

TEST_F(ChunkStoreTest, DiscardKeepsAChunkThatHasBeenRepaired) {
  const Digest digest = *store_.PutResult(Key("a"), BytesOf("payload"));
  ASSERT_TRUE(store_.PutResult(Key("b"), BytesOf("payload")).ok());
  ASSERT_TRUE(store_.Discard(Key("a"), digest).ok());
  EXPECT_EQ(store_.FindResult(Key("a")), std::nullopt);
  EXPECT_EQ(store_.FindResult(Key("b")), digest);
}

TEST_F(ChunkStoreTest, AChunkThatCannotBeReadIsNotTakenForDamaged) {
  const Digest digest = *store_.PutResult(Key("task"), BytesOf("payload"));
  const fs::path path = PathOf(store_, "chunks", digest);
  fs::remove(path);
  fs::create_symlink(path.filename(), path);  // leads to itself: opening it fails, for root too
  const Status status = store_.Get(digest).status();
  EXPECT_EQ(status.kind(), ErrorKind::kIo);
  EXPECT_NE(status.message().find(path.string()), std::string::npos) << status.message();
  EXPECT_EQ(store_.Discard(Key("task"), digest).kind(), ErrorKind::kIo);
  EXPECT_TRUE(fs::is_symlink(path));
}

TEST_F(ChunkStoreTest, ManyMayPutAtOnce) {
  constexpr int kThreads = 4, kTasks = 12;
  std::atomic<int> failures{0};
  {
    std::vector<std::jthread> pool;
    for (int t = 0; t < kThreads; ++t) {
      pool.emplace_back([&] {
        for (int task = 0; task < kTasks; ++task) {
          const std::string text = "result " + std::to_string(task / 2);
          const Digest key = Key("task " + std::to_string(task));
          const auto digest = store_.PutResult(key, BytesOf(text));
          if (!digest.ok() || store_.FindResult(key) != *digest || !store_.Get(*digest).ok()) ++failures;
        }
      });
    }
  }
  EXPECT_EQ(failures, 0);
  EXPECT_EQ(folder_.FileCount(), size_t{kTasks + kTasks / 2}) << "no temporary stays";
}

TEST(ChunkStoreOpenTest, FailsWhereNoFolderCanBe) {
  const TempFolder folder;
  WriteText(folder / "file", "x");
  EXPECT_EQ(ChunkStore::Open(folder / "file").status().kind(), ErrorKind::kIo);
}

}  // namespace
}  // namespace glint
