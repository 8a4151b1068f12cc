#include "coordinator/service/bake_service.h"

#include <gtest/gtest.h>

#include "common/base/files.h"
#include "tests/base/temp_folder.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;
using bake_fixture::SmallOptions;

class BakeServiceTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(SaveScene(bake_fixture::Generated("planes"), folder_ / "scene.glb").ok());
    scene_ = BytesOf(folder_ / "scene.glb");
    digest_ = Sha256(scene_);
    fs::create_directories(folder_ / "store");
    const BakeOptions small = SmallOptions();
    request_.scene = digest_;
    request_.name = "scene.glb";
    request_.settings = small.settings;
    request_.max_layers = 1;
    request_.layer_tolerance = 0;
    request_.vertices_per_task = 50;
    request_.estimate_slices = small.estimate_slices;
    options_.store = folder_ / "store";
    options_.threads = 1;
    options_.memory_bytes = uint64_t{1} << 26;
  }
  std::unique_ptr<BakeService> Open() const {
    Result<std::unique_ptr<BakeService>> service = BakeService::Open(options_);
    EXPECT_TRUE(service.ok()) << service.status().message();
    return service.ok() ? std::move(service).value() : nullptr;
  }
  /// Waits for the bake's end.
  static BakeStatus End(const BakeService& service, const std::string& id) {
    Result<BakeStatus> status = service.Get(id);
    while (status.ok() &&
           (status->entry.state == BakeState::kQueued || status->entry.state == BakeState::kRunning))
      status = service.Await(id, status->version, std::chrono::seconds(1));
    EXPECT_TRUE(status.ok()) << status.status().message();
    return status.ok() ? *status : BakeStatus();
  }
  std::vector<std::byte> Expected() const {
    BakeOptions options = SmallOptions();
    options.max_layers = 1;
    options.vertices_per_task = 50;
    EXPECT_TRUE(Bake(folder_ / "scene.glb", folder_ / "local.glint", options).ok());
    return BytesOf(folder_ / "local.glint");
  }

  const TempFolder folder_;
  std::vector<std::byte> scene_;
  Digest digest_;
  BakeRequest request_;
  ServiceOptions options_;
};

TEST_F(BakeServiceTest, GivesTheArchiveOfTheLocalBake) {
  const auto service = Open();
  EXPECT_FALSE(service->HasScene(digest_));
  EXPECT_EQ(service->Submit(request_).status().kind(), ErrorKind::kBadInput) << "its scene is not there";
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  EXPECT_TRUE(service->HasScene(digest_));
  const Result<BakeStatus> submitted = service->Submit(request_);
  ASSERT_TRUE(submitted.ok()) << submitted.status().message();
  const std::string id = submitted->entry.id;
  EXPECT_EQ(service->Submit(request_)->entry.id, id) << "the same request is the same bake";

  const BakeStatus ended = End(*service, id);
  ASSERT_EQ(ended.entry.state, BakeState::kDone) << ended.entry.error.message();
  const Result<fs::path> archive = service->ResultFile(id, false), report = service->ResultFile(id, true);
  ASSERT_TRUE(archive.ok() && report.ok());
  EXPECT_TRUE(BytesOf(*archive) == Expected());
  EXPECT_EQ(ended.archive_bytes, fs::file_size(*archive));
  EXPECT_TRUE(fs::exists(*report));
  EXPECT_FALSE(fs::exists(options_.store / ended.entry.bake_key)) << "its tasks serve nobody any more";

  ASSERT_TRUE(service->Delete(id).ok());
  EXPECT_FALSE(fs::exists(*archive));
  EXPECT_FALSE(service->HasScene(digest_));
  EXPECT_EQ(service->Delete(id).kind(), ErrorKind::kUsage);
}

TEST_F(BakeServiceTest, KeysBelongToOneRequest) {
  options_.running = 0;
  const auto service = Open();
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  request_.key = "monday";
  const Result<BakeStatus> first = service->Submit(request_);
  ASSERT_TRUE(first.ok());
  request_.max_layers = 2;
  const Result<BakeStatus> second = service->Submit(request_);
  EXPECT_EQ(second.status().kind(), ErrorKind::kUsage);
  EXPECT_NE(second.status().message().find("monday"), std::string::npos);
  EXPECT_EQ(service->List().size(), 1u);
}

TEST_F(BakeServiceTest, RefusesWhatIsNotWhatItSays) {
  options_.max_scene_bytes = scene_.size();
  options_.max_bakes = 1;
  options_.running = 0;
  const auto service = Open();
  std::vector<std::byte> damaged = scene_;
  damaged[10] ^= std::byte{1};
  EXPECT_EQ(service->PutScene(digest_, damaged).kind(), ErrorKind::kBadInput);
  EXPECT_FALSE(service->HasScene(digest_));
  damaged.push_back({});
  EXPECT_EQ(service->PutScene(Sha256(damaged), damaged).kind(), ErrorKind::kLimit);
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  for (const char* name : {"../scene.glb", "/etc/passwd", "", "a\nb"}) {
    request_.name = name;
    EXPECT_EQ(service->Submit(request_).status().kind(), ErrorKind::kBadInput) << name;
  }
  request_.name = "scene.glb";
  ASSERT_TRUE(service->Submit(request_).ok());
  request_.settings.seed = 2;
  EXPECT_EQ(service->Submit(request_).status().kind(), ErrorKind::kLimit);
  for (const char* id : {"", "..", "../journal", "0123456789abcdef"}) {
    EXPECT_EQ(service->Get(id).status().kind(), ErrorKind::kUsage);
    EXPECT_EQ(service->ResultFile(id, false).status().kind(), ErrorKind::kUsage);
    EXPECT_EQ(service->Delete(id).kind(), ErrorKind::kUsage);
  }
}

TEST_F(BakeServiceTest, SaysWhyABakeFailed) {
  const auto service = Open();
  const std::string text = "not glTF at all";
  const auto bytes = std::as_bytes(std::span(text));
  request_.scene = Sha256(bytes);
  ASSERT_TRUE(service->PutScene(request_.scene, bytes).ok());
  const Result<BakeStatus> submitted = service->Submit(request_);
  ASSERT_TRUE(submitted.ok());
  const BakeStatus ended = End(*service, submitted->entry.id);
  EXPECT_EQ(ended.entry.state, BakeState::kFailed);
  EXPECT_EQ(ended.entry.error.kind(), ErrorKind::kBadInput);
  EXPECT_NE(ended.entry.error.message().find("scene.glb"), std::string::npos) << ended.entry.error.message();
}

TEST_F(BakeServiceTest, CancelsAndResumes) {
  request_.vertices_per_task = 5;
  const auto service = Open();
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  const std::string id = service->Submit(request_)->entry.id;
  Result<BakeStatus> status = service->Get(id);
  while (status.ok() && status->progress.done < 3)
    status = service->Await(id, status->version, std::chrono::seconds(1));
  EXPECT_EQ(service->Delete(id).kind(), ErrorKind::kUsage) << "it is at work";
  ASSERT_TRUE(service->Cancel(id).ok());
  const BakeStatus cancelled = End(*service, id);
  ASSERT_EQ(cancelled.entry.state, BakeState::kCancelled);
  const fs::path tasks = options_.store / cancelled.entry.bake_key;
  EXPECT_GE(bake_fixture::StoredFiles(tasks, "tasks").size(), 3u);
  EXPECT_EQ(service->ResultFile(id, false).status().kind(), ErrorKind::kUsage);

  ASSERT_TRUE(service->Resume(id).ok());
  EXPECT_EQ(End(*service, id).entry.state, BakeState::kDone);
  EXPECT_EQ(service->Resume(id)->entry.state, BakeState::kDone) << "a bake that is done stays so";
  EXPECT_EQ(service->Cancel(id)->entry.state, BakeState::kDone);
}

TEST_F(BakeServiceTest, GoesOnWhereAnEarlierOneStopped) {
  request_.vertices_per_task = 5;
  std::string id;
  {
    const auto service = Open();
    ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
    id = service->Submit(request_)->entry.id;
    Result<BakeStatus> status = service->Get(id);
    while (status.ok() && status->progress.done < 3)
      status = service->Await(id, status->version, std::chrono::seconds(1));
    EXPECT_EQ(BakeService::Open(options_).status().kind(), ErrorKind::kUsage) << "one service a store";
  }
  const auto service = Open();
  EXPECT_EQ(End(*service, id).entry.state, BakeState::kDone);
  EXPECT_EQ(service->List().size(), 1u);
}

TEST(UrgencyTest, GrowsWithPriorityAndSoonerOrLaterWithWaiting) {
  EXPECT_GT(Urgency(9, 0), Urgency(5, 10));
  EXPECT_GT(Urgency(1, 3600 * 24), Urgency(100, 0));
}

TEST_F(BakeServiceTest, TakesTheMostUrgentFirst) {
  options_.running = 0;
  std::vector<std::string> ids;
  {
    const auto service = Open();
    ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
    for (const int priority : {1, 9, 5}) {
      request_.priority = priority;
      ids.push_back(service->Submit(request_)->entry.id);
    }
  }
  options_.running = 1;
  std::vector<int> order;
  options_.make_executor = [&](const BakeRequest& request) -> ExecutorFactory {
    order.push_back(request.priority);
    return [](const ExecutorInput&) -> Result<std::unique_ptr<Executor>> { return BadInput("enough"); };
  };
  const auto service = Open();
  for (const std::string& id : ids) EXPECT_EQ(End(*service, id).entry.state, BakeState::kFailed);
  EXPECT_EQ(order, (std::vector<int>{9, 5, 1}));
}

}  // namespace
}  // namespace glint
