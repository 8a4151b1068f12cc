// A NATS server with deploy/nats.conf: who has no certificate is not let in, and a worker may do no more than
// a worker does.

#include <gtest/gtest.h>
#include <nats/nats.h>
#include <signal.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "common/queue/nats_queue.h"
#include "tests/base/temp_folder.h"
#include "tests/cluster/nats_server.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using bake_fixture::BytesOf;

constexpr int64_t kWaitMs = 500;

void Sleep(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

class NatsRightsTest : public testing::Test {
 protected:
  void SetUp() override {
    MakeCertificates(keys());
    nats_ = std::make_unique<NatsServer>(folder_ / "nats", keys());
  }
  fs::path keys() const { return folder_ / "keys"; }
  NatsOptions As(const std::string& user, const std::string& authority = "keys") const {
    const fs::path own = folder_ / authority;
    return {nats_->url(), (keys() / "ca.pem").string(), (own / (user + ".pem")).string(),
            (own / (user + ".key")).string(), user == "worker" ? kWorkerInbox : "_INBOX"};
  }
  std::unique_ptr<NatsQueue> Connect(const NatsOptions& options) const {
    Result<std::unique_ptr<NatsQueue>> queue = NatsQueue::Connect(options);
    EXPECT_TRUE(queue.ok()) << queue.status().message();
    return queue.ok() ? std::move(queue).value() : nullptr;
  }
  /// Whether somebody is let in.
  static bool Reaches(const NatsOptions& options) {
    const Result<std::unique_ptr<NatsQueue>> queue = NatsQueue::Connect(options);
    for (int i = 0; queue.ok() && i < 100; ++i) {
      if ((*queue)->CheckReachable().ok()) return true;
      Sleep(0.01);
    }
    return false;
  }

  const TempFolder folder_;
  std::unique_ptr<NatsServer> nats_;
};

TEST_F(NatsRightsTest, LetsInWhoeverHasACertificate) {
  EXPECT_TRUE(Reaches(As("coordinator")));
  EXPECT_TRUE(Reaches(As("worker")));

  NatsOptions none = As("worker");
  none.cert_file = none.key_file = "";
  EXPECT_FALSE(Reaches(none)) << "without a certificate";
  NatsOptions plain = none;
  plain.ca_file = "";
  plain.url.replace(0, 3, "nats");
  EXPECT_FALSE(Reaches(plain)) << "unencrypted";
  EXPECT_FALSE(Reaches(As("client"))) << "one that is no user";
  MakeCertificates(folder_ / "others");
  EXPECT_FALSE(Reaches(As("worker", "others"))) << "of another authority";
  NatsOptions fooled = As("worker");
  fooled.ca_file = (folder_ / "others/ca.pem").string();
  EXPECT_FALSE(Reaches(fooled)) << "nor does a worker believe a server of another authority";
}

/// A worker that does what it should not.
class RogueWorker {
 public:
  explicit RogueWorker(const NatsOptions& options) {
    natsOptions* made = nullptr;
    natsOptions_Create(&made);
    natsOptions_SetURL(made, options.url.c_str());
    natsOptions_SetSecure(made, true);
    natsOptions_LoadCATrustedCertificates(made, options.ca_file.c_str());
    natsOptions_LoadCertificatesChain(made, options.cert_file.c_str(), options.key_file.c_str());
    natsOptions_SetCustomInboxPrefix(made, options.inbox.c_str());
    natsOptions_SetErrorHandler(
        made,
        [](natsConnection*, natsSubscription*, natsStatus, void* count) {
          ++*static_cast<std::atomic<int>*>(count);
        },
        &violations_);
    connected_ = natsConnection_Connect(&connection_, made) == NATS_OK;
    natsOptions_Destroy(made);
  }
  ~RogueWorker() {
    natsConnection_Close(connection_);
    natsConnection_Destroy(connection_);
  }
  bool connected() const { return connected_; }

  /// Whether the server refused to pass it on.
  bool IsRefused(const std::string& subject, const std::string& text) {
    return Violates([&] { natsConnection_PublishString(connection_, subject.c_str(), text.c_str()); });
  }
  bool MayNotListen(const std::string& subject) {
    natsSubscription* subscription = nullptr;
    const bool refused =
        Violates([&] { natsConnection_SubscribeSync(&subscription, connection_, subject.c_str()); });
    natsSubscription_Destroy(subscription);
    return refused;
  }

 private:
  template <class Act>
  bool Violates(const Act& act) {
    const int before = violations_;
    act();
    natsConnection_FlushTimeout(connection_, kWaitMs);
    for (int i = 0; i < 50 && violations_ == before; ++i) Sleep(0.01);
    return violations_ > before;
  }

  natsConnection* connection_ = nullptr;
  bool connected_ = false;
  std::atomic<int> violations_{0};
};

TEST_F(NatsRightsTest, WorkersOnlyWork) {
  const auto coordinator = Connect(As("coordinator"));
  const Digest bake = Sha256({});
  const std::string key = bake.Hex();
  ASSERT_TRUE(coordinator->Open({bake, "any", 1, 30}).ok());
  ASSERT_TRUE(coordinator->Publish(bake, std::vector<TaskMessage>{{bake, 1}}).ok());
  const auto waiting = [&] {
    const Result<std::optional<QueueState>> state = coordinator->State(bake);
    EXPECT_TRUE(state.ok() && *state) << "stream and consumer are there";
    return state.ok() && *state ? (*state)->waiting : 0;
  };
  ASSERT_EQ(waiting(), 1u);

  RogueWorker rogue(As("worker"));
  ASSERT_TRUE(rogue.connected());
  const std::string task = "bake." + key + ".task", api = "$JS.API.";
  EXPECT_TRUE(rogue.IsRefused(task, key + " 2")) << "a task of its own";
  for (const std::string& call :
       {std::string("STREAM.DELETE.BAKE"), std::string("STREAM.PURGE.BAKE"),
        std::string("STREAM.UPDATE.BAKE"), std::string("STREAM.CREATE.EVIL"),
        std::string("STREAM.MSG.DELETE.BAKE"), std::string("STREAM.MSG.GET.BAKE"),
        "CONSUMER.DELETE.BAKE." + key, std::string("CONSUMER.DURABLE.CREATE.BAKE.evil"),
        std::string("STREAM.LIST"), std::string("ACCOUNT.PURGE.$G")})
    EXPECT_TRUE(rogue.IsRefused(api + call, "{}")) << call;
  for (const char* subject : {"bake.>", "_INBOX.>", "$JS.>", ">"})
    EXPECT_TRUE(rogue.MayNotListen(subject)) << subject;
  EXPECT_EQ(waiting(), 1u) << "nothing came of it";
  EXPECT_FALSE(rogue.IsRefused(api + "CONSUMER.LIST.BAKE", "{}")) << "what workers do is allowed";

  // Nor can the coordinator do what it never does.
  RogueWorker other(As("coordinator"));
  EXPECT_TRUE(other.IsRefused(api + "STREAM.DELETE.BAKE", ""));
  EXPECT_TRUE(other.IsRefused(api + "STREAM.CREATE.EVIL", "{}"));

  const auto worker = Connect(As("worker"));
  const Result<std::vector<QueuedBake>> bakes = worker->List();
  ASSERT_TRUE(bakes.ok()) << bakes.status().message();
  ASSERT_EQ(bakes->size(), 1u);
  const auto subscription = worker->Subscribe(bake);
  ASSERT_TRUE(subscription.ok()) << subscription.status().message();
  const auto lease = (*subscription)->Fetch(2);
  ASSERT_TRUE(lease.ok() && *lease);
  EXPECT_EQ((*lease)->message(), (TaskMessage{bake, 1}));
  (*lease)->Done();
  EXPECT_TRUE(coordinator->Close(bake).ok());
}

TEST_F(NatsRightsTest, BakesWithTheseRights) {
  const fs::path scene = folder_ / "scene.glb", store = folder_ / "store";
  ASSERT_TRUE(SaveScene(bake_fixture::Generated("planes"), scene).ok());
  fs::create_directories(store);
  const auto words = [&](const std::string& user) {
    const NatsOptions options = As(user);
    return std::vector<std::string>{
        "--nats",          options.url,  "--nats-ca",      options.ca_file, "--nats-cert",
        options.cert_file, "--nats-key", options.key_file, "--threads",     "1"};
  };
  const auto command = [&](const std::vector<std::string>& own, const std::string& user) {
    std::vector<std::string> all = {GLINT_PROGRAM};
    const std::vector<std::string> more = words(user);
    all.insert(all.end(), own.begin(), own.end());
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  const auto bake = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> all = {"bake",
                                    scene.string(),
                                    "-o",
                                    (folder_ / out).string(),
                                    "--directions",
                                    "162",
                                    "--layers",
                                    "1",
                                    "--layer-tolerance",
                                    "0",
                                    "--max-rays",
                                    "512",
                                    "--estimate",
                                    "0",
                                    "--vertices-per-task",
                                    "50"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  BackgroundProcess worker(command({"worker", "--store", store.string()}, "worker"), folder_ / "worker.log");
  const ProcessResult baked = RunProcess(
      command(bake("cluster.glint", {"--executor", "cluster", "--work-dir", store.string()}), "coordinator"));
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  ASSERT_EQ(RunProcess(command(bake("local.glint", {}), "coordinator")).exit_code, 0);
  EXPECT_TRUE(BytesOf(folder_ / "cluster.glint") == BytesOf(folder_ / "local.glint"));
  EXPECT_TRUE(fs::exists(store)) << "where the worker waits for the next bake";
  worker.Signal(SIGTERM);
  EXPECT_EQ(worker.Wait(), 0);
}

}  // namespace
}  // namespace glint
