#include "common/base/memory.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/base/temp_folder.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMiB = uint64_t{1} << 20;

/// A machine's /proc and /sys, as far as limits go.
class MemoryTest : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text) const {
    fs::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << text << '\n';
  }
  void SetGroups(const std::string& lines) const { Write("proc/self/cgroup", lines); }
  void Limit(const std::string& name, uint64_t mib) const {
    Write("sys/fs/cgroup/" + name, std::to_string(mib * kMiB));
  }
  uint64_t UsableMiB() const { return UsableMemory(root_.path()) / kMiB; }

  const TempFolder root_;
  const uint64_t machine_ = UsableMiB();  // nothing there says less
};

TEST_F(MemoryTest, IsTheMachinesWithoutGroups) {
  EXPECT_GT(machine_, 100u);
  SetGroups("0::/");
  EXPECT_EQ(UsableMiB(), machine_);
  SetGroups("nonsense\n1:memory\n\n::");
  EXPECT_EQ(UsableMiB(), machine_);
}

TEST_F(MemoryTest, TakesTheLowestLimitOfVersion2) {
  SetGroups("0::/system.slice/glint.service");
  Write("sys/fs/cgroup/system.slice/glint.service/memory.max", "max");
  EXPECT_EQ(UsableMiB(), machine_);
  Limit("system.slice/memory.max", 64);
  EXPECT_EQ(UsableMiB(), 64u);
  Limit("system.slice/glint.service/memory.high", 32);
  EXPECT_EQ(UsableMiB(), 32u);
  Limit("another.slice/memory.max", 1);
  EXPECT_EQ(UsableMiB(), 32u);
}

TEST_F(MemoryTest, SeesAContainersLimitAtItsRoot) {
  SetGroups("0::/");
  Limit("memory.max", 48);
  EXPECT_EQ(UsableMiB(), 48u);
}

TEST_F(MemoryTest, TakesTheLowestLimitOfVersion1) {
  SetGroups("7:cpu,cpuacct:/docker/ab\n4:memory:/docker/ab\n1:name=systemd:/docker/ab\n0::/");
  Write("sys/fs/cgroup/memory/docker/ab/memory.limit_in_bytes", "9223372036854771712");
  EXPECT_EQ(UsableMiB(), machine_);
  Limit("memory/docker/memory.limit_in_bytes", 40);
  EXPECT_EQ(UsableMiB(), 40u);
  Limit("cpu,cpuacct/docker/ab/memory.limit_in_bytes", 1);
  EXPECT_EQ(UsableMiB(), 40u);
}

TEST_F(MemoryTest, SeesAContainersLimitUnderTheNameOutside) {
  SetGroups("4:memory:/docker/ab");  // no such folder in here
  Limit("memory/memory.limit_in_bytes", 24);
  EXPECT_EQ(UsableMiB(), 24u);
}

TEST_F(MemoryTest, SeesVersion2BesideVersion1) {
  SetGroups("1:cpu:/a\n0::/a");
  Limit("unified/a/memory.max", 20);
  EXPECT_EQ(UsableMiB(), 20u);
}

TEST(ResidentMemoryTest, IsWhatThisProcessHas) {
  EXPECT_GT(ResidentMemory(), kMiB);
  EXPECT_LT(ResidentMemory(), UsableMemory());
}

}  // namespace
}  // namespace glint
