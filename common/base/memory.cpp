#include "common/base/memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

uint64_t MachineMemory() {
  return static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGE_SIZE));
}

/// Where a version of control groups keeps the limits on memory.
struct Hierarchy {
  const char* mount;
  std::vector<const char*> limits;
};
const Hierarchy& Version1() {
  static const Hierarchy hierarchy{"sys/fs/cgroup/memory", {"memory.limit_in_bytes"}};
  return hierarchy;
}
/// On its own, and beside version 1. Above memory.high a process is slowed down until it is useless.
const std::vector<Hierarchy>& Version2() {
  static const std::vector<Hierarchy> hierarchies = {
      {"sys/fs/cgroup", {"memory.max", "memory.high"}},
      {"sys/fs/cgroup/unified", {"memory.max", "memory.high"}}};
  return hierarchies;
}

/// kNoLimit also for a file that is not there, and for "max".
uint64_t ReadLimit(const fs::path& file) {
  std::ifstream stream(file);
  uint64_t bytes = 0;
  return stream >> bytes ? bytes : kNoLimit;
}

/// The lowest limit of `group`, "/a/b", and of those above it. A container sees its own group as the
/// mount's root while the name may be the one outside: folders that are not there are passed over.
uint64_t LowestLimit(const fs::path& root, const Hierarchy& hierarchy, const fs::path& group) {
  uint64_t lowest = kNoLimit;
  for (fs::path at = group.relative_path();; at = at.parent_path()) {
    for (const char* limit : hierarchy.limits)
      lowest = std::min(lowest, ReadLimit(root / hierarchy.mount / at / limit));
    if (at.empty()) return lowest;
  }
}

/// @param line  of /proc/self/cgroup: "ID:CONTROLLERS:GROUP", without controllers in version 2
uint64_t LimitOf(const fs::path& root, const std::string& line) {
  const size_t first = line.find(':');
  const size_t second = first == std::string::npos ? first : line.find(':', first + 1);
  if (second == std::string::npos) return kNoLimit;
  const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
  const fs::path group = line.substr(second + 1);
  if (controllers.find(",memory,") != std::string::npos) return LowestLimit(root, Version1(), group);
  if (controllers != ",,") return kNoLimit;
  uint64_t lowest = kNoLimit;
  for (const Hierarchy& hierarchy : Version2())
    lowest = std::min(lowest, LowestLimit(root, hierarchy, group));
  return lowest;
}

}  // namespace

uint64_t UsableMemory(const fs::path& root) {
  uint64_t usable = MachineMemory();
  std::ifstream groups(root / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) usable = std::min(usable, LimitOf(root, line));
  return usable;
}

uint64_t ResidentMemory() {
  std::ifstream sizes("/proc/self/statm");
  uint64_t all = 0, resident = 0;
  sizes >> all >> resident;
  return resident * static_cast<uint64_t>(sysconf(_SC_PAGE_SIZE));
}

}  // namespace glint
