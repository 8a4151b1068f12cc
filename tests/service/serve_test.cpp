// The service as a process: clients, kills, and callers who have no right to anything.

#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/base/temp_folder.h"
#include "tests/cluster/nats_server.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;
using bake_fixture::StoredFiles;

void Sleep(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

class ServeTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(SaveScene(bake_fixture::Generated("planes"), folder_ / "scene.glb").ok());
    fs::create_directories(store());
  }
  void StartService(const std::vector<std::string>& more = {}) {
    std::vector<std::string> command = {GLINT_PROGRAM, "serve", "--store",   store().string(),
                                        "--listen",    host_,   "--threads", "1"};
    command.insert(command.end(), more.begin(), more.end());
    service_ = std::make_unique<BackgroundProcess>(command, folder_ / "serve.log");
    for (int i = 0; i < 500 && Client({"status"}).exit_code != 0; ++i) Sleep(0.02);
  }
  ProcessResult Client(std::vector<std::string> words) const {
    words.insert(words.begin(), GLINT_PROGRAM);
    words.insert(words.end(), {"--to", host_});
    return RunProcess(words);
  }
  std::vector<std::string> Accuracy() const {
    return {"--directions",        "162", "--layers", "2", "--tolerance", "0", "--max-rays", "512",
            "--vertices-per-task", "20"};
  }
  std::vector<std::string> Submit(const std::vector<std::string>& more) const {
    std::vector<std::string> words = {"submit", (folder_ / "scene.glb").string()};
    const std::vector<std::string> accuracy = Accuracy();
    words.insert(words.end(), accuracy.begin(), accuracy.end());
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::vector<std::byte> Expected() const {
    std::vector<std::string> words = {GLINT_PROGRAM, "bake", (folder_ / "scene.glb").string(), "-o",
                                      (folder_ / "local.glint").string()};
    const std::vector<std::string> accuracy = Accuracy();
    words.insert(words.end(), accuracy.begin(), accuracy.end());
    const ProcessResult baked = RunProcess(words);
    EXPECT_EQ(baked.exit_code, 0) << baked.err;
    return BytesOf(folder_ / "local.glint");
  }
  fs::path store() const { return folder_ / "store"; }

  const TempFolder folder_;
  const std::string host_ = "127.0.0.1:" + std::to_string(FreePort());
  std::unique_ptr<BackgroundProcess> service_;
};

TEST_F(ServeTest, BakesWhatIsSubmitted) {
  StartService();
  const std::string out = (folder_ / "remote.glint").string();
  const ProcessResult submitted = Client(Submit({"--wait", "-o", out, "--json"}));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  const nlohmann::json bake = nlohmann::json::parse(submitted.out);
  EXPECT_EQ(bake["state"], "done");
  EXPECT_TRUE(BytesOf(out) == Expected());
  EXPECT_TRUE(fs::exists(out + ".json"));

  // Once more: the same bake, and nothing to upload.
  const ProcessResult again = Client(Submit({"--json"}));
  EXPECT_EQ(nlohmann::json::parse(again.out)["id"], bake["id"]);
  const std::string id = bake["id"], copy = (folder_ / "copy.glint").string();
  EXPECT_EQ(Client({"fetch", id, "-o", copy}).exit_code, 0);
  EXPECT_TRUE(BytesOf(copy) == BytesOf(out));
  EXPECT_EQ(nlohmann::json::parse(Client({"status", "--json"}).out)["bakes"].size(), 1u);
  EXPECT_EQ(Client({"delete", id}).exit_code, 0);
  EXPECT_EQ(Client({"fetch", id, "-o", copy}).exit_code, 2) << "it is forgotten";

  service_->Signal(SIGTERM);
  EXPECT_EQ(service_->Wait(), 0);
  EXPECT_EQ(Client({"status"}).exit_code, 6) << "nobody is there";
}

TEST_F(ServeTest, GoesOnAfterKills) {
  StartService();
  const ProcessResult submitted = Client(Submit({"--json"}));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  const std::string id = nlohmann::json::parse(submitted.out)["id"];
  BackgroundProcess watch({GLINT_PROGRAM, "watch", id, "--to", host_}, folder_ / "watch.log");
  size_t finished = 0;
  for (int kill = 0; kill < 5; ++kill) {
    while (StoredFiles(store(), "tasks").size() <= finished && watch.Running()) Sleep(0.005);
    service_.reset();
    EXPECT_GE(StoredFiles(store(), "tasks").size(), finished);
    finished = StoredFiles(store(), "tasks").size();
    StartService();
  }
  EXPECT_EQ(watch.Wait(), 0) << "a client sees a bake through its service's deaths";
  const std::string out = (folder_ / "remote.glint").string();
  ASSERT_EQ(Client({"fetch", id, "-o", out}).exit_code, 0);
  EXPECT_TRUE(BytesOf(out) == Expected());
  EXPECT_GT(nlohmann::json::parse(Client({"status", id, "--json"}).out)["archive_bytes"], 0);
}

TEST_F(ServeTest, CancelledAndFailedBakesHaveTheirExitCodes) {
  StartService();
  const std::string id = nlohmann::json::parse(Client(Submit({"--json"})).out)["id"];
  while (StoredFiles(store(), "tasks").empty()) Sleep(0.005);
  ASSERT_EQ(Client({"cancel", id}).exit_code, 0);
  EXPECT_EQ(Client({"watch", id}).exit_code, 5);
  ASSERT_EQ(Client({"resume", id}).exit_code, 0);
  EXPECT_EQ(Client({"watch", id}).exit_code, 0);

  std::ofstream(folder_ / "bad.glb") << "this is no scene";
  const ProcessResult bad = Client({"submit", (folder_ / "bad.glb").string(), "--wait"});
  EXPECT_EQ(bad.exit_code, 3) << bad.err;
  EXPECT_NE(bad.err.find("bad.glb"), std::string::npos) << bad.err;
  EXPECT_EQ(Client({"watch", "../journal.sqlite"}).exit_code, 2);
}

TEST_F(ServeTest, ListensOnLoopbackAlone) {
  const auto serve = [&](const std::vector<std::string>& words) {
    std::vector<std::string> command = {GLINT_PROGRAM, "serve", "--store", store().string()};
    command.insert(command.end(), words.begin(), words.end());
    return RunProcess(command);
  };
  const ProcessResult open = serve({"--listen", "0.0.0.0:0"});
  EXPECT_EQ(open.exit_code, 2);
  EXPECT_NE(open.err.find("--tls-cert"), std::string::npos) << open.err;
  StartService();
  EXPECT_EQ(serve({"--listen", "127.0.0.1:0"}).exit_code, 2) << "the store has its service";
}

TEST_F(ServeTest, HasWorkersBake) {
  NatsServer nats(folder_ / "nats");
  StartService({"--workers", "--nats", nats.url(), "--lease", "1"});
  const auto start_worker = [&] {
    return std::make_unique<BackgroundProcess>(
        std::vector<std::string>{GLINT_PROGRAM, "worker", "--store", store().string(), "--nats", nats.url(),
                                 "--threads", "1"},
        folder_ / "worker.log");
  };
  auto worker = start_worker();
  const std::string id = nlohmann::json::parse(Client(Submit({"--json"})).out)["id"];
  // All at once.
  while (StoredFiles(store(), "tasks").size() < 5) Sleep(0.005);
  service_.reset();
  worker.reset();
  nats.KillAndForget();
  nats.Start();
  worker = start_worker();
  StartService({"--workers", "--nats", nats.url(), "--lease", "1"});
  EXPECT_EQ(Client({"watch", id}).exit_code, 0);
  const std::string out = (folder_ / "remote.glint").string();
  ASSERT_EQ(Client({"fetch", id, "-o", out}).exit_code, 0);
  EXPECT_TRUE(BytesOf(out) == Expected());
}

}  // namespace
}  // namespace glint
