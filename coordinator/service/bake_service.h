#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "coordinator/bake.h"
#include "coordinator/service/journal.h"
#include "coordinator/service/service_meter.h"
#include "coordinator/service/store_garbage.h"

namespace glint {

/// A bake as clients see it.
struct BakeStatus {
  JournalEntry entry;
  BakeProgress progress;       ///< kRunning
  uint64_t archive_bytes = 0;  ///< kDone
  uint64_t version = 0;        ///< grows with every change
};

struct ServiceOptions {
  std::filesystem::path store;  ///< journal, scenes, archives, and a folder for each bake's tasks
  int running = 2;              ///< bakes at a time; the others wait, by priority and then by age
  size_t max_bakes = 1000;      ///< in the journal
  uint64_t max_scene_bytes = uint64_t{1} << 30;
  int threads = 0;            ///< 0: all cores
  uint64_t memory_bytes = 0;  ///< as in BakeOptions, but for all bakes together
  /// What no bake refers to goes so long after it was last touched; 0: it stays.
  std::chrono::seconds keep_unused = std::chrono::hours(168);
  /// Who runs a bake's tasks; empty: threads of this process.
  std::function<ExecutorFactory(const BakeRequest&)> make_executor;
};

/// What was removed from a store.
struct Garbage {
  uint64_t scenes = 0;
  uint64_t results = 0;      ///< archives and reports
  uint64_t folders = 0;      ///< of bakes' tasks
  uint64_t temporaries = 0;  ///< files that somebody was killed over
  uint64_t bytes = 0;
};

/// What `glint serve` does, without its network. State is the store and its journal: killed at any moment,
/// the next service on the same store goes on. Thread-safe. What clients name are identifiers and digests,
/// never paths.
///   journal.sqlite   what was asked for and what became of it
///   scenes/ab/<digest>   files that clients sent, by SHA-256 of their bytes
///   archives/<id>.glint, .glint.json   results
///   <bake key>/   tasks and chunks (coordinator/work_folder.h)
class BakeService {
 public:
  /// Takes up what an earlier service left. kUsage: another one is at work on the store; kIo, kBadInput: the
  /// store or its journal.
  static Result<std::unique_ptr<BakeService>> Open(const ServiceOptions& options);
  /// Stops the bakes at work; they stay in the journal as running.
  ~BakeService();

  /// Whether the store has it; if so, it counts as touched.
  bool HasScene(const Digest& digest) const;
  /// kLimit: too large; kBadInput: the bytes have another digest; kIo.
  Status PutScene(const Digest& digest, std::span<const std::byte> bytes);
  uint64_t max_scene_bytes() const { return options_.max_scene_bytes; }

  /// Safe to repeat: the same request, or key, gives the bake that is there. kUsage: the key belongs to
  /// another request; kBadInput: its scene is not here; kLimit: too many bakes.
  Result<BakeStatus> Submit(const BakeRequest& request);
  std::vector<BakeStatus> List() const;
  /// kUsage from here on: there is no such bake.
  Result<BakeStatus> Get(const std::string& id) const;
  /// Waits until the bake's version is above `version`, or for `timeout`, and gives its status.
  Result<BakeStatus> Await(const std::string& id, uint64_t version, std::chrono::milliseconds timeout) const;
  Result<BakeStatus> Cancel(const std::string& id);
  Result<BakeStatus> Resume(const std::string& id);
  /// kUsage also: it has not ended.
  Status Delete(const std::string& id);
  /// Where a result is. kUsage also: the bake is not done.
  Result<std::filesystem::path> ResultFile(const std::string& id, bool report) const;

  ServiceCounts Counts() const;
  /// kIo: nothing can be written to the store.
  Status CheckStore() const;
  const std::filesystem::path& store() const { return options_.store; }
  /// Removes scenes, archives and folders of tasks that belong to no bake and were not touched for `age`;
  /// names that a service does not give stay. Safe beside all other calls, and beside bakes of other
  /// processes in the same store.
  Garbage CollectGarbage(std::chrono::seconds age);

 private:
  struct Slot {
    BakeStatus status;
    BakeMeter meter;
    bool cancel = false;
  };

  BakeService(const ServiceOptions& options, Journal journal, int lock)
      : options_(options), journal_(std::move(journal)), lock_(lock) {}
  Status TakeUp();
  void RunBakes();
  std::string Next();
  void RunOne(const std::string& id);
  Result<BakeReport> Bake(const BakeRequest& request, const std::string& id);
  void NoteKey(const std::string& id, const Digest& bake_key);
  void NoteEnd(const std::string& id, const Status& status);
  void NoteProgress(const std::string& id, const BakeProgress& progress);
  bool MustStop(const std::string& id) const;
  Status Change(Slot* slot, BakeState state, Status error = {});
  Result<Slot*> Find(const std::string& id);
  Result<const Slot*> Find(const std::string& id) const;
  void CollectRepeatedly();
  bool IsUnusedScene(const std::filesystem::path& path, FileTime before) const;
  bool IsUnusedResult(const std::filesystem::path& path) const;
  /// Removes files below `folder` that are unused, asked under the lock, and those half written; how many of
  /// the first.
  uint64_t CollectFiles(const char* folder, FileTime before,
                        const std::function<bool(const std::filesystem::path&)>& is_unused, Garbage* removed);
  void CollectFolders(FileTime before, Garbage* removed);
  bool Uses(const std::function<bool(const JournalEntry&)>& what) const;
  std::filesystem::path ScenePath(const Digest& digest) const;
  std::filesystem::path ArchivePath(const std::string& id) const;

  const ServiceOptions options_;
  Journal journal_;
  const int lock_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::map<std::string, Slot> slots_;
  ServiceCounts counts_;
  bool ending_ = false;
  std::vector<std::thread> runners_;
};

}  // namespace glint
