#pragma once

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/base/files.h"
#include "tests/base/temp_folder.h"
#include "tests/cluster/nats_server.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint {

inline void Sleep(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

class ClusterTest : public testing::Test {
 protected:
  void SetUp() override {
    const Status saved = SaveScene(bake_fixture::Generated("planes", 600), scene());
    ASSERT_TRUE(saved.ok()) << saved.message();
    const ProcessResult local = RunProcess(BakeCommand("local", {"--keep-work"}));
    ASSERT_EQ(local.exit_code, 0) << local.err;
    expected_ = bake_fixture::BytesOf(folder_ / "local.glint");
    tasks_ = bake_fixture::StoredFiles(folder_ / "local.glint.work", "tasks").size();
    std::filesystem::create_directories(store());
  }

  std::vector<std::string> BakeCommand(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> command = {GLINT_PROGRAM,
                                        "bake",
                                        scene().string(),
                                        "-o",
                                        (folder_ / (out + ".glint")).string(),
                                        "--directions",
                                        "162",
                                        "--layers",
                                        "2",
                                        "--layer-tolerance",
                                        "0",
                                        "--max-rays",
                                        "512",
                                        "--vertices-per-task",
                                        vertices_per_task_,
                                        "--threads",
                                        "1"};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }
  std::vector<std::string> ClusterBakeCommand() const {
    std::vector<std::string> words = {"--executor", "cluster", "--work-dir", store().string(), "--nats",
                                      url(),        "--lease", "1",          "--keep-work"};
    const std::vector<std::string> more = More();
    words.insert(words.end(), more.begin(), more.end());
    return BakeCommand("cluster", words);
  }
  std::unique_ptr<BackgroundProcess> StartWorker(const std::vector<std::string>& environment = {}) const {
    return std::make_unique<BackgroundProcess>(
        std::vector<std::string>{GLINT_PROGRAM, "worker", "--store", store().string(), "--nats", url(),
                                 "--threads", "1", "--json"},
        folder_ / "workers.log", environment);
  }
  std::unique_ptr<BackgroundProcess> StartBake() const {
    return std::make_unique<BackgroundProcess>(ClusterBakeCommand(), folder_ / "bakes.log");
  }
  void ExpectArchive() const {
    EXPECT_TRUE(bake_fixture::BytesOf(folder_ / "cluster.glint") == expected_);
    EXPECT_EQ(bake_fixture::StoredFiles(store(), "tasks").size(), tasks_);
  }
  std::string Text(const std::string& file) const {
    const std::vector<std::byte> bytes = bake_fixture::BytesOf(folder_ / file);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  /// Notes which results are there, and that those noted before are the same files still: a task that is
  /// computed again gets a new record.
  void CheckFinished() {
    for (const std::filesystem::path& record : bake_fixture::StoredFiles(store(), "tasks")) {
      struct stat info = {};
      if (stat(record.c_str(), &info) != 0) continue;
      const ino_t known = finished_.emplace(record, info.st_ino).first->second;
      EXPECT_EQ(known, info.st_ino) << record << " was computed again";
    }
  }

  /// Words of the cluster's bake beside those of every bake.
  virtual std::vector<std::string> More() const { return {}; }
  virtual std::string url() const { return nats_.url(); }
  std::filesystem::path scene() const { return folder_ / "scene.glb"; }
  std::filesystem::path store() const { return folder_ / "store"; }

  const TempFolder folder_;
  std::string vertices_per_task_ = "40";
  NatsServer nats_{folder_ / "nats"};
  std::vector<std::byte> expected_;
  size_t tasks_ = 0;
  std::map<std::filesystem::path, ino_t> finished_;
};

}  // namespace glint
