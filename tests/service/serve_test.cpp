// The service as a process: clients, kills, and callers who have no right to anything.

#include <gtest/gtest.h>
#include <httplib.h>
#include <signal.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>
#include <utility>

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
  /// Waits until a client gets an answer.
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
    words.insert(words.end(), client_words_.begin(), client_words_.end());
    return RunProcess(words);
  }
  /// A client with words of its own in place of `client_words_`.
  ProcessResult ClientWith(const std::vector<std::string>& own, const std::vector<std::string>& words) {
    const std::vector<std::string> usual = std::exchange(client_words_, own);
    ProcessResult result = Client(words);
    client_words_ = usual;
    return result;
  }
  std::string Text(const std::string& file) const {
    const std::vector<std::byte> bytes = BytesOf(folder_ / file);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  std::vector<std::string> Accuracy() const {
    return {"--directions",        "162", "--layers", "2", "--layer-tolerance", "0", "--max-rays", "512",
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
  std::vector<std::string> client_words_;  ///< who the client is
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
  auto process = start_worker();
  const std::string id = nlohmann::json::parse(Client(Submit({"--json"})).out)["id"];
  // All at once.
  while (StoredFiles(store(), "tasks").size() < 5) Sleep(0.005);
  service_.reset();
  process.reset();
  nats.KillAndForget();
  nats.Start();
  process = start_worker();
  StartService({"--workers", "--nats", nats.url(), "--lease", "1"});
  const ProcessResult watched = Client({"watch", id, "--json"});
  EXPECT_EQ(watched.exit_code, 0) << watched.err;
  const std::string out = (folder_ / "remote.glint").string();
  ASSERT_EQ(Client({"fetch", id, "-o", out}).exit_code, 0);
  EXPECT_TRUE(BytesOf(out) == Expected());

  // An object a line, which tell who did what; the last one that it is done.
  std::istringstream lines(watched.out);
  nlohmann::json bake, worker;
  for (std::string line; std::getline(lines, line);) {
    bake = nlohmann::json::parse(line);
    for (const nlohmann::json& one : bake.value("workers", nlohmann::json::array())) worker = one;
  }
  EXPECT_EQ(bake["state"], "done");
  ASSERT_TRUE(worker.is_object()) << watched.out;
  EXPECT_NE(worker["name"].get<std::string>().find(":" + std::to_string(process->pid())), std::string::npos);
  EXPECT_GT(worker["tasks"], 0);
  EXPECT_GT(worker["seconds"], 0);
}

// ---- Who may call ----

class SecureServeTest : public ServeTest {
 protected:
  void SetUp() override {
    ServeTest::SetUp();
    MakeCertificates(folder_ / "ours");
    MakeCertificates(folder_ / "theirs");
    client_words_ = Tls("ours", "ours");
  }
  std::string Key(const std::string& authority, const std::string& file) const {
    return (folder_ / authority / file).string();
  }
  /// Of a client that believes one authority and has a certificate of another.
  std::vector<std::string> Tls(const std::string& believed, const std::string& own) const {
    return {"--tls-ca",  Key(believed, "ca.pem"), "--tls-cert", Key(own, "client.pem"),
            "--tls-key", Key(own, "client.key")};
  }
  std::vector<std::string> ServiceWords() const {
    return {"--tls-cert",      Key("ours", "service.pem"), "--tls-key", Key("ours", "service.key"),
            "--tls-client-ca", Key("ours", "ca.pem")};
  }
  /// What a client without Glint sees of the service's door.
  ProcessResult Knock(const std::vector<std::string>& more) const {
    std::vector<std::string> command = {GLINT_OPENSSL, "s_client", "-connect",
                                        host_,         "-tls1_2",  "-alpn",
                                        "h2",          "-CAfile",  Key("ours", "ca.pem")};
    command.insert(command.end(), more.begin(), more.end());
    return RunProcess(command);
  }
  size_t StoredScenes() const {
    size_t count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(store() / "scenes"))
      count += entry.is_regular_file();
    return count;
  }
};

TEST_F(SecureServeTest, CallersWithoutACertificateGetNowhere) {
  StartService(ServiceWords());
  ASSERT_EQ(Client({"status"}).exit_code, 0) << Text("serve.log");
  EXPECT_EQ(ClientWith({}, {"status"}).exit_code, 6) << "unencrypted";
  EXPECT_EQ(ClientWith(Tls("ours", "theirs"), {"status"}).exit_code, 6) << "another authority's certificate";
  EXPECT_EQ(ClientWith(Tls("ours", "theirs"), Submit({})).exit_code, 6);
  EXPECT_EQ(ClientWith(Tls("theirs", "ours"), {"status"}).exit_code, 6) << "clients do not believe strangers";
  EXPECT_NE(Knock({}).exit_code, 0) << "no certificate at all";
  EXPECT_EQ(Knock({"-cert", Key("ours", "client.pem"), "-key", Key("ours", "client.key")}).exit_code, 0);
  EXPECT_EQ(StoredScenes(), 0u);
  EXPECT_EQ(Client(Submit({"--wait"})).exit_code, 0) << "who has one gets a bake";
}

TEST_F(SecureServeTest, TokensSayWhoMayDoWhat) {
  std::string lines;
  for (const char* right : {"read", "submit", "admin"}) {
    const ProcessResult made =
        RunProcess({GLINT_PROGRAM, "token", right, "--right", right, "-o", (folder_ / right).string()});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    EXPECT_EQ(made.out.find(Text(right).substr(0, 64)), std::string::npos) << "it is printed nowhere";
    lines += made.out;
    EXPECT_EQ(fs::status(folder_ / right).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  }
  std::ofstream(folder_ / "tokens") << lines;
  std::ofstream(folder_ / "wrong") << std::string(64, '0') << "\n";
  const auto as = [&](const std::string& token) {
    std::vector<std::string> words = Tls("ours", "ours");
    words.insert(words.end(), {"--token-file", (folder_ / token).string()});
    return words;
  };
  client_words_ = as("read");
  std::vector<std::string> words = ServiceWords();
  words.insert(words.end(), {"--token-file", (folder_ / "tokens").string()});
  StartService(words);
  ASSERT_EQ(Client({"status"}).exit_code, 0) << Text("serve.log");

  for (const auto& stranger : {Tls("ours", "ours"), as("wrong")}) {
    for (const auto& call : {std::vector<std::string>{"status"}, Submit({})}) {
      const ProcessResult refused = ClientWith(stranger, call);
      EXPECT_EQ(refused.exit_code, 2);
      EXPECT_NE(refused.err.find("--token-file"), std::string::npos) << refused.err;
    }
  }
  const ProcessResult reader = ClientWith(as("read"), Submit({}));
  EXPECT_EQ(reader.exit_code, 2);
  EXPECT_NE(reader.err.find("needs the right 'submit'"), std::string::npos) << reader.err;
  EXPECT_EQ(StoredScenes(), 0u);

  const ProcessResult submitted = ClientWith(as("submit"), Submit({"--wait", "--json"}));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  const std::string id = nlohmann::json::parse(submitted.out)["id"];
  EXPECT_EQ(ClientWith(as("read"), {"fetch", id, "-o", (folder_ / "copy.glint").string()}).exit_code, 0);
  EXPECT_EQ(ClientWith(as("submit"), {"delete", id}).exit_code, 2);
  EXPECT_EQ(ClientWith(as("admin"), {"delete", id}).exit_code, 0);
  EXPECT_NE(Text("serve.log").find("client 'submit' calls Submit"), std::string::npos) << Text("serve.log");
  EXPECT_EQ(Text("serve.log").find(Text("submit").substr(0, 64)), std::string::npos)
      << "tokens are in no log";
}

TEST_F(ServeTest, RefusesATokenFileThatIsNone) {
  std::ofstream(folder_ / "tokens") << "alice submit not-a-digest\n";
  const ProcessResult serve = RunProcess({GLINT_PROGRAM, "serve", "--store", store().string(), "--token-file",
                                          (folder_ / "tokens").string(), "--listen", "127.0.0.1:0"});
  EXPECT_EQ(serve.exit_code, 3);
  EXPECT_NE(serve.err.find("tokens: line 1"), std::string::npos) << serve.err;
}

// ---- Watching it ----

/// A number of /metrics; -1: it is not there.
double MetricOf(const std::string& text, const std::string& name) {
  const size_t at = text.find("\n" + name + " ");
  return at == std::string::npos ? -1 : std::stod(text.substr(at + name.size() + 2));
}

class WatchedServeTest : public ServeTest {
 protected:
  std::string Listen(int port) const { return "127.0.0.1:" + std::to_string(port); }
  /// -1: no answer.
  static int Health(int port) {
    httplib::Client http("127.0.0.1", port);
    const auto reply = http.Get("/healthz");
    return reply ? reply->status : -1;
  }
  static std::string Metrics(int port) {
    httplib::Client http("127.0.0.1", port);
    const auto reply = http.Get("/metrics");
    return reply ? reply->body : "";
  }
  /// Waits for a state of health.
  static bool Becomes(int port, int wanted) {
    for (int i = 0; i < 500; ++i) {
      if (Health(port) == wanted) return true;
      Sleep(0.02);
    }
    return false;
  }
  const int serve_port_ = FreePort(), worker_port_ = FreePort();
};

TEST_F(WatchedServeTest, ShowsServiceAndWorkers) {
  NatsServer nats(folder_ / "nats");
  StartService({"--workers", "--nats", nats.url(), "--lease", "1", "--metrics-listen", Listen(serve_port_),
                "--log-format", "json"});
  BackgroundProcess worker(
      {GLINT_PROGRAM, "worker", "--store", store().string(), "--nats", nats.url(), "--threads", "1",
       "--metrics-listen", Listen(worker_port_), "--log-format", "json"},
      folder_ / "worker.log");
  ASSERT_TRUE(Becomes(serve_port_, 200) && Becomes(worker_port_, 200))
      << Text("serve.log") << Text("worker.log");
  ASSERT_EQ(Client(Submit({"--wait"})).exit_code, 0);

  const std::string service = Metrics(serve_port_), own = Metrics(worker_port_);
  EXPECT_EQ(MetricOf(service, "glint_bakes{state=\"done\"}"), 1) << service;
  EXPECT_EQ(MetricOf(service, "glint_queue_up"), 1) << service;
  EXPECT_GT(MetricOf(service, "glint_rays_total"), 0) << service;
  const double tasks = MetricOf(service, "glint_tasks_total{outcome=\"computed\"}");
  EXPECT_GT(tasks, 1) << service;
  EXPECT_EQ(MetricOf(own, "glint_worker_tasks_total{outcome=\"computed\"}"), tasks) << own;
  EXPECT_EQ(MetricOf(own, "glint_worker_rays_total"), MetricOf(service, "glint_rays_total")) << own;
  EXPECT_GT(MetricOf(own, "glint_worker_stage_seconds_total{stage=\"gather\"}"), 0) << own;

  for (const char* file : {"serve.log", "worker.log"}) {
    std::istringstream lines(Text(file));
    int count = 0;
    for (std::string line; std::getline(lines, line); ++count) {
      const nlohmann::json entry = nlohmann::json::parse(line, nullptr, false);
      ASSERT_TRUE(entry.is_object()) << file << ": " << line;
      EXPECT_TRUE(entry.contains("time") && entry.contains("level") && entry.contains("message")) << line;
    }
    EXPECT_GT(count, 1) << file;
  }
}

TEST_F(WatchedServeTest, IsNotHealthyWithoutItsStoreOrItsQueue) {
  NatsServer nats(folder_ / "nats");
  StartService({"--workers", "--nats", nats.url(), "--metrics-listen", Listen(serve_port_)});
  BackgroundProcess worker({GLINT_PROGRAM, "worker", "--store", store().string(), "--nats", nats.url(),
                            "--threads", "1", "--metrics-listen", Listen(worker_port_)},
                           folder_ / "worker.log");
  const auto both_become = [&](int status) {
    return Becomes(serve_port_, status) && Becomes(worker_port_, status);
  };
  ASSERT_TRUE(both_become(200)) << Text("serve.log") << Text("worker.log");
  nats.Kill();
  EXPECT_TRUE(both_become(503));
  nats.Start();
  EXPECT_TRUE(both_become(200));
  fs::rename(store(), folder_ / "unmounted");
  EXPECT_TRUE(both_become(503));
  fs::rename(folder_ / "unmounted", store());
  EXPECT_TRUE(both_become(200));
  EXPECT_NE(Text("serve.log").find("not healthy: queue"), std::string::npos) << Text("serve.log");
  EXPECT_NE(Text("worker.log").find("not healthy: store"), std::string::npos) << Text("worker.log");
}

}  // namespace
}  // namespace glint
