#include <gtest/gtest.h>
#include <httplib.h>

#include <atomic>

#include "common/monitor/metrics.h"
#include "common/monitor/monitor_server.h"

namespace glint {
namespace {

TEST(MetricsTest, AreWrittenAsPrometheusReadsThem) {
  const std::vector<Metric> metrics = {
      {"a_total", MetricKind::kCounter, "Two\nlines", {{{{"kind", "x\"\\\n"}, {"b", "c"}}, 3}, {{}, 0.25}}},
      SingleMetric("b_bytes", MetricKind::kGauge, "Large", 1e12)};
  EXPECT_EQ(ToPrometheus(metrics),
            "# HELP a_total Two\\nlines\n"
            "# TYPE a_total counter\n"
            "a_total{kind=\"x\\\"\\\\\\n\",b=\"c\"} 3\n"
            "a_total 0.25\n"
            "# HELP b_bytes Large\n"
            "# TYPE b_bytes gauge\n"
            "b_bytes 1e+12\n");
}

TEST(MetricsTest, TellOfTheProcess) {
  const std::string text = ToPrometheus(ProcessMetrics("an execution"));
  EXPECT_NE(text.find("execution=\"an execution\"} 1\n"), std::string::npos) << text;
  for (const char* name :
       {"process_cpu_seconds_total", "process_resident_memory_bytes", "glint_usable_memory_bytes"}) {
    const size_t at = text.find(std::string("\n") + name + " ");
    ASSERT_NE(at, std::string::npos) << text;
    EXPECT_GT(std::stod(text.substr(at + 2 + std::string(name).size())), 0) << name;
  }
}

class MonitorServerTest : public testing::Test {
 protected:
  Monitored What() {
    return {[] { return std::vector{SingleMetric("answer", MetricKind::kGauge, "", 42)}; },
            {{"store", [] { return Status(); }},
             {"queue", [this] { return broken_ ? IoError("it is secret why") : Status(); }}}};
  }
  std::atomic<bool> broken_{false};
};

TEST_F(MonitorServerTest, ShowsMetricsAndHealth) {
  const auto server = MonitorServer::Start("127.0.0.1:0", What());
  ASSERT_TRUE(server.ok()) << server.status().message();
  httplib::Client client("127.0.0.1", (*server)->port());
  const auto metrics = client.Get("/metrics");
  ASSERT_TRUE(metrics);
  EXPECT_EQ(metrics->status, 200);
  EXPECT_NE(metrics->body.find("\nanswer 42\n"), std::string::npos) << metrics->body;
  EXPECT_EQ(metrics->get_header_value("Content-Type"), "text/plain; version=0.0.4; charset=utf-8");

  const auto healthy = client.Get("/healthz");
  ASSERT_TRUE(healthy);
  EXPECT_EQ(healthy->status, 200);
  EXPECT_EQ(healthy->body, "store: ok\nqueue: ok\n");
  broken_ = true;
  testing::internal::CaptureStderr();
  for (int i = 0; i < 3; ++i) {
    const auto sick = client.Get("/healthz");
    ASSERT_TRUE(sick);
    EXPECT_EQ(sick->status, 503);
    EXPECT_EQ(sick->body, "store: ok\nqueue: failed\n");
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "warning: not healthy: queue: it is secret why\n");
  broken_ = false;
  EXPECT_EQ(client.Get("/healthz")->status, 200);
}

TEST_F(MonitorServerTest, AnswersNothingElse) {
  const auto server = MonitorServer::Start("127.0.0.1:0", What());
  ASSERT_TRUE(server.ok()) << server.status().message();
  httplib::Client client("127.0.0.1", (*server)->port());
  EXPECT_EQ(client.Get("/")->status, 404);
  EXPECT_EQ(client.Get("/../etc/passwd")->status, 404);
  EXPECT_NE(client.Post("/metrics", std::string(100'000, 'x'), "text/plain")->status, 200);
  EXPECT_NE(client.Delete("/metrics")->status, 200);
}

TEST_F(MonitorServerTest, RefusesWhatIsNoAddressOrTaken) {
  for (const char* wrong : {"", ":", ":80", "127.0.0.1", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:65536",
                            "127.0.0.1:-1", "no.such.host.invalid:0"}) {
    EXPECT_EQ(MonitorServer::Start(wrong, What()).status().kind(), ErrorKind::kUsage) << wrong;
  }
  const auto first = MonitorServer::Start("127.0.0.1:0", What());
  ASSERT_TRUE(first.ok());
  const std::string same = "127.0.0.1:" + std::to_string((*first)->port());
  EXPECT_EQ(MonitorServer::Start(same, What()).status().kind(), ErrorKind::kUsage) << "it is in use";
}

}  // namespace
}  // namespace glint
