#include "coordinator/service/bake_service.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "common/base/files.h"
#include "coordinator/service/service_metrics.h"
#include "coordinator/work_folder.h"
#include "tests/base/temp_folder.h"
#include "tests/cluster/fake_queue.h"
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

// ---- Garbage ----

/// Something that a service gives such names to, last touched some hours ago.
void PutOld(const fs::path& path, const std::string& text, int hours) {
  fs::create_directories(path.parent_path());
  ASSERT_TRUE(PublishFile(path, std::as_bytes(std::span(text))).ok());
  fs::last_write_time(path, FileTime::clock::now() - std::chrono::hours(hours));
}
/// A folder of tasks that was left `hours` ago.
void PutOldFolder(const fs::path& folder, int hours) {
  PutOld(folder / "tasks/ab/cd", "x", hours);
  for (const fs::path& part : {folder / "tasks/ab", folder / "tasks", folder})
    fs::last_write_time(part, FileTime::clock::now() - std::chrono::hours(hours));
}
const std::string kSomeKey(64, 'd');

TEST_F(BakeServiceTest, CollectsWhatNoBakeRefersTo) {
  options_.running = 0;
  options_.keep_unused = std::chrono::seconds(0);
  const auto service = Open();
  const fs::path store = options_.store;
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  const std::string id = service->Submit(request_)->entry.id;
  const fs::path used = store / "scenes" / digest_.Hex().substr(0, 2) / digest_.Hex();
  fs::last_write_time(used, FileTime::clock::now() - std::chrono::hours(100));
  const fs::path scene = store / "scenes/dd" / kSomeKey, fresh = store / "scenes/ee" / std::string(64, 'e');
  PutOld(scene, "orphan", 100);
  PutOld(fresh, "just uploaded", 1);
  PutOld(store / "scenes/dd/notes.txt", "nobody's business", 100);
  PutOld(store / "archives" / (id + ".glint"), "of the bake", 100);
  PutOld(store / "archives/0123456789abcdef.glint", "orphan", 100);
  PutOld(store / "archives/0123456789abcdef.glint.json", "orphan", 100);
  PutOldFolder(store / kSomeKey, 100);
  PutOldFolder(store / std::string(64, 'f'), 1);
  // Half an upload.
  PutOld(store / "scenes/dd" / ("." + kSomeKey + ".1.2.tmp"), "half", 100);

  const Garbage removed = service->CollectGarbage(std::chrono::hours(24));
  EXPECT_EQ(removed.scenes, 1u);
  EXPECT_EQ(removed.results, 2u) << "archive and report";
  EXPECT_EQ(removed.folders, 1u);
  EXPECT_EQ(removed.temporaries, 1u);
  EXPECT_GT(removed.bytes, 0u);
  EXPECT_EQ(service->Counts().collected_bytes, removed.bytes);
  for (const fs::path& gone :
       {scene, store / "archives/0123456789abcdef.glint", store / "archives/0123456789abcdef.glint.json",
        store / kSomeKey, store / "scenes/dd" / ("." + kSomeKey + ".1.2.tmp")})
    EXPECT_FALSE(fs::exists(gone)) << gone;
  for (const fs::path& there :
       {used, fresh, store / "scenes/dd/notes.txt", store / "archives" / (id + ".glint"),
        store / std::string(64, 'f'), store / "journal.sqlite"})
    EXPECT_TRUE(fs::exists(there)) << there;
  EXPECT_EQ(service->CollectGarbage(std::chrono::hours(24)).bytes, 0u);
}

TEST_F(BakeServiceTest, KeepsWhatAClientWasToldIsThere) {
  options_.running = 0;
  options_.keep_unused = std::chrono::seconds(0);
  const auto service = Open();
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  const fs::path path = options_.store / "scenes" / digest_.Hex().substr(0, 2) / digest_.Hex();
  fs::last_write_time(path, FileTime::clock::now() - std::chrono::hours(100));
  ASSERT_TRUE(service->HasScene(digest_)) << "so the client does not send it";
  EXPECT_EQ(service->CollectGarbage(std::chrono::hours(24)).scenes, 0u);
  EXPECT_TRUE(service->Submit(request_).ok());
}

TEST_F(BakeServiceTest, CollectsNothingThatIsAtWork) {
  options_.running = 0;
  options_.keep_unused = std::chrono::seconds(0);
  const auto service = Open();
  // A bake of another process in the same store.
  const Digest key = *Digest::FromHex(kSomeKey);
  {
    const Result<WorkFolder> other = WorkFolder::Open(options_.store, key);
    ASSERT_TRUE(other.ok());
    EXPECT_EQ(service->CollectGarbage(std::chrono::seconds(-1)).folders, 0u);
    EXPECT_TRUE(fs::exists(options_.store / kSomeKey));
  }
  EXPECT_EQ(service->CollectGarbage(std::chrono::seconds(-1)).folders, 1u);
  EXPECT_FALSE(fs::exists(options_.store / kSomeKey));

  // A file that is being written.
  fs::create_directories(options_.store / "scenes/dd");
  Result<FilePublisher> upload = FilePublisher::Create(options_.store / "scenes/dd" / kSomeKey);
  ASSERT_TRUE(upload.ok() && upload->Write(scene_).ok());
  EXPECT_EQ(service->CollectGarbage(std::chrono::seconds(-1)).temporaries, 0u);
  EXPECT_TRUE(upload->Commit().ok());
}

TEST_F(BakeServiceTest, CollectsBesideUploadsAndBakes) {
  options_.keep_unused = std::chrono::seconds(0);
  const auto service = Open();
  std::atomic<bool> done{false};
  // Everything that is not in use counts as old.
  std::thread collector([&] {
    while (!done) service->CollectGarbage(std::chrono::seconds(-1));
  });
  std::vector<std::string> ids;
  for (int seed = 0; seed < 3; ++seed) {
    request_.settings.seed = static_cast<uint32_t>(seed);
    // A client whose scene went between its upload and its request sends it again.
    Result<BakeStatus> submitted = BadInput("not yet");
    for (int attempt = 0; attempt < 1000 && !submitted.ok(); ++attempt) {
      ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
      submitted = service->Submit(request_);
    }
    ASSERT_TRUE(submitted.ok()) << submitted.status().message();
    ids.push_back(submitted->entry.id);
  }
  for (const std::string& id : ids) {
    const BakeStatus ended = End(*service, id);
    EXPECT_EQ(ended.entry.state, BakeState::kDone) << ended.entry.error.message();
    EXPECT_TRUE(fs::exists(*service->ResultFile(id, false)));
  }
  done = true;
  collector.join();
}

TEST_F(BakeServiceTest, CollectsWhenItIsStarted) {
  options_.running = 0;
  const fs::path scene = options_.store / "scenes/dd" / kSomeKey;
  PutOld(scene, "orphan", 1000);
  const auto service = Open();
  for (int i = 0; i < 1000 && fs::exists(scene); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_FALSE(fs::exists(scene));
}

// ---- Watching it ----

TEST_F(BakeServiceTest, CountsWhatItDoes) {
  const auto service = Open();
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  const std::string id = service->Submit(request_)->entry.id;
  ASSERT_EQ(End(*service, id).entry.state, BakeState::kDone);
  const ServiceCounts counts = service->Counts();
  BakeOptions options = SmallOptions();
  options.max_layers = 1;
  options.vertices_per_task = 50;
  const Result<BakeReport> local = Bake(folder_ / "scene.glb", folder_ / "local.glint", options);
  ASSERT_TRUE(local.ok());
  EXPECT_EQ(counts.tasks_computed, local->tasks);
  EXPECT_EQ(counts.tasks_found, 0u);
  EXPECT_EQ(counts.rays, local->rays);
  for (const char* stage : {"load", "fit", "layer", "merge", "write"}) {
    ASSERT_TRUE(counts.stage_seconds.count(stage)) << stage;
    EXPECT_GE(counts.stage_seconds.at(stage), 0) << stage;
  }
  EXPECT_GT(counts.stage_seconds.at("layer"), 0);

  FakeQueue queue;
  const std::string text = ToPrometheus(ServiceMetrics(*service, &queue));
  for (const std::string& line :
       {std::string("glint_bakes{state=\"done\"} 1\n"), std::string("glint_bakes{state=\"queued\"} 0\n"),
        "glint_tasks_total{outcome=\"computed\"} " + std::to_string(local->tasks) + "\n",
        "glint_rays_total " + std::to_string(local->rays) + "\n", std::string("glint_queue_up 1\n"),
        std::string("glint_queue_tasks{state=\"waiting\"} 0\n")})
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  EXPECT_EQ(ToPrometheus(ServiceMetrics(*service, nullptr)).find("glint_queue"), std::string::npos);
}

TEST_F(BakeServiceTest, AsksTheQueueAboutBakesAtWork) {
  FakeQueue queue;
  std::atomic<bool> taken{false}, end{false};
  // A bake whose tasks lie in the queue.
  options_.make_executor = [&](const BakeRequest&) -> ExecutorFactory {
    return [&](const ExecutorInput& input) -> Result<std::unique_ptr<Executor>> {
      const Digest bake = *Digest::FromHex(input.store.root().filename().string());
      EXPECT_TRUE(queue.Open({bake, "x", 1, 30}).ok());
      EXPECT_TRUE(queue.Publish(bake, std::vector<TaskMessage>(3)).ok());
      const auto lease = queue.Take(bake);
      taken = true;
      while (!end) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return BadInput("enough");
    };
  };
  const auto service = Open();
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  const std::string id = service->Submit(request_)->entry.id;
  for (int i = 0; i < 5000 && !taken; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  const std::string text = ToPrometheus(ServiceMetrics(*service, &queue));
  for (const char* line :
       {"glint_queue_tasks{state=\"waiting\"} 2\n", "glint_queue_tasks{state=\"in_flight\"} 1\n",
        "glint_bakes{state=\"running\"} 1\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  queue.SetDown(true);
  EXPECT_NE(ToPrometheus(ServiceMetrics(*service, &queue)).find("glint_queue_up 0\n"), std::string::npos);
  end = true;
  EXPECT_EQ(End(*service, id).entry.state, BakeState::kFailed);
}

TEST_F(BakeServiceTest, BakesShareTheMemory) {
  options_.running = 2;
  options_.memory_bytes = 1000;
  std::atomic<uint64_t> given{0};
  options_.make_executor = [&](const BakeRequest&) -> ExecutorFactory {
    return [&](const ExecutorInput& input) -> Result<std::unique_ptr<Executor>> {
      given = input.memory_bytes;
      return BadInput("enough");
    };
  };
  const auto service = Open();
  ASSERT_TRUE(service->PutScene(digest_, scene_).ok());
  End(*service, service->Submit(request_)->entry.id);
  EXPECT_EQ(given, 500u);
}

}  // namespace
}  // namespace glint
