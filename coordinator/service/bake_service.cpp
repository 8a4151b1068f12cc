#include "coordinator/service/bake_service.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <new>
#include <system_error>
#include <tuple>
#include <utility>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/memory.h"
#include "coordinator/bake_target.h"
#include "coordinator/work_folder.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr size_t kIdLength = 16;  ///< hexadecimal digits
constexpr auto kCollectPeriod = std::chrono::hours(1);

/// From the client's key, or else from the request: so that a request which is sent twice begins one bake.
std::string MakeId(const BakeRequest& request) {
  const std::string text = request.key.empty() ? ToJson(request) : request.key;
  return Hasher()
      .String(request.key.empty() ? "request" : "key")
      .String(text)
      .Finish()
      .Hex()
      .substr(0, kIdLength);
}

/// Names are labels in messages and reports.
Status CheckName(const std::string& name) {
  const bool plain =
      !name.empty() && name.find('/') == std::string::npos &&
      std::none_of(name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) < 32; });
  return plain ? Status() : BadInput("a scene's name is a file name without folders");
}

Result<int> LockStore(const fs::path& store) {
  const fs::path path = store / "serve.lock";
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (fd < 0) return IoError(path.string() + ": cannot open: " + std::generic_category().message(errno));
  if (flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  const int error = errno;
  close(fd);
  if (error == EWOULDBLOCK)
    return UsageError(store.string() + ": another 'glint serve' is at work on this store; use that one");
  return IoError(path.string() + ": cannot lock: " + std::generic_category().message(error));
}

Status NoSuchBake(const std::string& id) {
  return UsageError("there is no bake '" + id + "'; 'glint status' lists them");
}

bool HasEnded(BakeState state) {
  return state == BakeState::kDone || state == BakeState::kFailed || state == BakeState::kCancelled;
}

}  // namespace

Result<std::unique_ptr<BakeService>> BakeService::Open(const ServiceOptions& options) {
  for (const char* folder : {"scenes", "archives"})
    GLINT_RETURN_IF_ERROR(CreateFolders(options.store / folder));
  GLINT_ASSIGN_OR_RETURN(const int lock, LockStore(options.store));
  Result<Journal> journal = Journal::Open(options.store / "journal.sqlite");
  if (!journal.ok()) {
    close(lock);
    return journal.status();
  }
  std::unique_ptr<BakeService> service(new BakeService(options, std::move(journal).value(), lock));
  GLINT_RETURN_IF_ERROR(service->TakeUp());
  for (int i = 0; i < options.running; ++i)
    service->runners_.emplace_back([s = service.get()] { s->RunBakes(); });
  if (options.keep_unused.count() > 0)
    service->runners_.emplace_back([s = service.get()] { s->CollectRepeatedly(); });
  return service;
}

BakeService::~BakeService() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  for (std::thread& runner : runners_) runner.join();
  close(lock_);
}

Status BakeService::TakeUp() {
  GLINT_ASSIGN_OR_RETURN(std::vector<JournalEntry> entries, journal_.Load());
  for (JournalEntry& entry : entries) {
    if (entry.state == BakeState::kRunning) entry.state = BakeState::kQueued;
    Slot& slot = slots_[entry.id];
    std::error_code error;
    if (entry.state == BakeState::kDone)
      slot.status.archive_bytes = fs::file_size(ArchivePath(entry.id), error);
    slot.status.entry = std::move(entry);
  }
  return {};
}

// ---- Scenes ----

fs::path BakeService::ScenePath(const Digest& digest) const {
  const std::string hex = digest.Hex();
  return options_.store / "scenes" / hex.substr(0, 2) / hex;
}
fs::path BakeService::ArchivePath(const std::string& id) const {
  return options_.store / "archives" / (id + ".glint");
}

bool BakeService::HasScene(const Digest& digest) const {
  std::error_code error;
  const fs::path path = ScenePath(digest);
  if (!fs::is_regular_file(path, error)) return false;
  // Whoever hears that it is here submits it next, and will not send it.
  fs::last_write_time(path, FileTime::clock::now(), error);
  return true;
}

Status BakeService::PutScene(const Digest& digest, std::span<const std::byte> bytes) {
  if (bytes.size() > options_.max_scene_bytes) {
    return LimitExceeded("a scene of " + std::to_string(bytes.size()) + " bytes, more than this service's " +
                         std::to_string(options_.max_scene_bytes) + " (glint serve --max-scene)");
  }
  if (Sha256(bytes) != digest)
    return BadInput("the scene's bytes are not those of its digest; send it again");
  const fs::path path = ScenePath(digest);
  GLINT_RETURN_IF_ERROR(CreateFolders(path.parent_path()));
  return PublishFile(path, bytes);
}

// ---- What clients ask for ----

Result<BakeStatus> BakeService::Submit(const BakeRequest& request) {
  GLINT_RETURN_IF_ERROR(CheckName(request.name));
  const std::string id = MakeId(request);
  const std::lock_guard lock(mutex_);
  if (const auto known = slots_.find(id); known != slots_.end()) {
    if (ToJson(known->second.status.entry.request) == ToJson(request)) return known->second.status;
    return UsageError("the key '" + request.key + "' belongs to another request, bake " + id +
                      "; choose another key");
  }
  if (slots_.size() >= options_.max_bakes) {
    return LimitExceeded(std::to_string(slots_.size()) +
                         " bakes are in the journal, no more fit; delete some");
  }
  if (!HasScene(request.scene))
    return BadInput("the scene " + request.scene.Hex() + " is not in the store; upload it first");
  Slot slot;
  slot.status.entry = {id, request, BakeState::kQueued, {}, "", static_cast<int64_t>(std::time(nullptr))};
  GLINT_RETURN_IF_ERROR(journal_.Put(slot.status.entry));
  changed_.notify_all();
  return slots_.emplace(id, std::move(slot)).first->second.status;
}

std::vector<BakeStatus> BakeService::List() const {
  const std::lock_guard lock(mutex_);
  std::vector<BakeStatus> list;
  for (const auto& [id, slot] : slots_) list.push_back(slot.status);
  std::stable_sort(list.begin(), list.end(), [](const BakeStatus& a, const BakeStatus& b) {
    return a.entry.submitted_unix < b.entry.submitted_unix;
  });
  return list;
}

Result<const BakeService::Slot*> BakeService::Find(const std::string& id) const {
  const auto found = slots_.find(id);
  return found == slots_.end() ? NoSuchBake(id) : Result<const Slot*>(&found->second);
}
Result<BakeService::Slot*> BakeService::Find(const std::string& id) {
  const auto found = slots_.find(id);
  return found == slots_.end() ? NoSuchBake(id) : Result<Slot*>(&found->second);
}

Result<BakeStatus> BakeService::Get(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  GLINT_ASSIGN_OR_RETURN(const Slot* slot, Find(id));
  return slot->status;
}

Result<BakeStatus> BakeService::Await(const std::string& id, uint64_t version,
                                      std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] {
    const auto slot = slots_.find(id);
    return ending_ || slot == slots_.end() || slot->second.status.version > version;
  });
  GLINT_ASSIGN_OR_RETURN(const Slot* slot, Find(id));
  return slot->status;
}

Result<BakeStatus> BakeService::Cancel(const std::string& id) {
  const std::lock_guard lock(mutex_);
  GLINT_ASSIGN_OR_RETURN(Slot * slot, Find(id));
  if (slot->status.entry.state == BakeState::kQueued)
    GLINT_RETURN_IF_ERROR(Change(slot, BakeState::kCancelled));
  slot->cancel = slot->status.entry.state == BakeState::kRunning;
  return slot->status;
}

Result<BakeStatus> BakeService::Resume(const std::string& id) {
  const std::lock_guard lock(mutex_);
  GLINT_ASSIGN_OR_RETURN(Slot * slot, Find(id));
  const BakeState state = slot->status.entry.state;
  if (state == BakeState::kFailed || state == BakeState::kCancelled)
    GLINT_RETURN_IF_ERROR(Change(slot, BakeState::kQueued));
  return slot->status;
}

Status BakeService::Delete(const std::string& id) {
  const std::lock_guard lock(mutex_);
  GLINT_ASSIGN_OR_RETURN(const Slot* slot, std::as_const(*this).Find(id));
  const JournalEntry entry = slot->status.entry;
  if (!HasEnded(entry.state)) return UsageError("bake " + id + " has not ended; cancel it first");
  // The journal first: what is left over after a kill is only space, never a bake without its files.
  GLINT_RETURN_IF_ERROR(journal_.Remove(id));
  slots_.erase(id);
  std::error_code error;
  for (const fs::path& file : ResultFiles(ArchivePath(id))) fs::remove(file, error);
  if (!Uses([&](const JournalEntry& e) { return e.request.scene == entry.request.scene; }))
    fs::remove(ScenePath(entry.request.scene), error);
  const std::optional<Digest> key = Digest::FromHex(entry.bake_key);  // none: it did not get so far
  if (key && !Uses([&](const JournalEntry& e) { return e.bake_key == entry.bake_key; })) {
    if (const Result<bool> gone = WorkFolder::RemoveUnused(options_.store, *key); !gone.ok())
      Log(LogLevel::kWarning, gone.status().message(), {{"bake", id}});
  }
  changed_.notify_all();
  return {};
}

bool BakeService::Uses(const std::function<bool(const JournalEntry&)>& what) const {
  return std::any_of(slots_.begin(), slots_.end(),
                     [&](const auto& slot) { return what(slot.second.status.entry); });
}

Result<fs::path> BakeService::ResultFile(const std::string& id, bool report) const {
  const std::lock_guard lock(mutex_);
  GLINT_ASSIGN_OR_RETURN(const Slot* slot, Find(id));
  if (slot->status.entry.state != BakeState::kDone) return UsageError("bake " + id + " is not done");
  return fs::path(ArchivePath(id).string() + (report ? ".json" : ""));
}

ServiceCounts BakeService::Counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

Status BakeService::CheckStore() const { return CheckWritable(options_.store); }

// ---- Garbage ----

Garbage BakeService::CollectGarbage(std::chrono::seconds age) {
  const FileTime before = FileTime::clock::now() - age;
  Garbage removed;
  removed.scenes = CollectFiles(
      "scenes", before, [&](const fs::path& path) { return IsUnusedScene(path, before); }, &removed);
  removed.results = CollectFiles(
      "archives", before, [&](const fs::path& path) { return IsUnusedResult(path); }, &removed);
  CollectFolders(before, &removed);
  const std::lock_guard lock(mutex_);
  counts_.collected_bytes += removed.bytes;
  return removed;
}

bool BakeService::IsUnusedScene(const fs::path& path, FileTime before) const {
  const std::optional<Digest> digest = Digest::FromHex(path.filename().string());
  std::error_code error;
  // Once more, for who asked for it meanwhile has touched it.
  return digest && path == ScenePath(*digest) && fs::last_write_time(path, error) < before &&
         !Uses([&](const JournalEntry& e) { return e.request.scene == *digest; });
}

bool BakeService::IsUnusedResult(const fs::path& path) const {
  const std::string name = path.filename().string(), id = name.substr(0, name.find('.'));
  const std::vector<fs::path> files = ResultFiles(ArchivePath(id));
  return std::find(files.begin(), files.end(), path) != files.end() && id.size() == kIdLength &&
         slots_.count(id) == 0;
}

uint64_t BakeService::CollectFiles(const char* folder, FileTime before,
                                   const std::function<bool(const fs::path&)>& is_unused, Garbage* removed) {
  uint64_t count = 0;
  for (const fs::path& path : FilesOlderThan(options_.store / folder, before)) {
    const uint64_t bytes = BytesIn(path);
    const std::lock_guard lock(mutex_);  // no bake comes to use it between the question and the answer
    std::error_code error;
    const bool unused = is_unused(path) && fs::remove(path, error);
    const bool temporary = !unused && RemoveOrphan(path);
    count += unused;
    removed->temporaries += temporary;
    if (unused || temporary) removed->bytes += bytes;
  }
  return count;
}

void BakeService::CollectFolders(FileTime before, Garbage* removed) {
  std::error_code error;
  for (fs::directory_iterator i(options_.store, error), end; !error && i != end; i.increment(error)) {
    const std::string name = i->path().filename().string();
    const std::optional<Digest> key = Digest::FromHex(name);
    std::error_code gone;
    if (!key || !i->is_directory(gone) || LastChange(i->path()) >= before) continue;
    {
      const std::lock_guard lock(mutex_);
      if (Uses([&](const JournalEntry& e) { return e.bake_key == name && e.state != BakeState::kDone; }))
        continue;
    }
    // A bake that begins now finds the folder locked, waits, and makes it anew.
    const uint64_t bytes = BytesIn(i->path());
    const Result<bool> unused = WorkFolder::RemoveUnused(options_.store, *key);
    if (!unused.ok()) Log(LogLevel::kWarning, unused.status().message(), {{"bake_key", name}});
    if (!unused.ok() || !*unused) continue;
    ++removed->folders;
    removed->bytes += bytes;
  }
}

void BakeService::CollectRepeatedly() {
  for (;;) {
    const Garbage removed = CollectGarbage(options_.keep_unused);
    if (removed.bytes > 0 || removed.folders > 0) {
      Log(LogLevel::kNote, "removed what no bake needs: " + std::to_string(removed.scenes) + " scenes, " +
                               std::to_string(removed.results) + " archives and reports, " +
                               std::to_string(removed.folders) + " folders of tasks, " +
                               std::to_string(removed.temporaries) + " unfinished files; " +
                               std::to_string(removed.bytes >> 20) + " MiB");
    }
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kCollectPeriod, [this] { return ending_; });
    if (ending_) return;
  }
}

// ---- Work ----

void BakeService::RunBakes() {
  for (;;) {
    const std::string id = Next();
    if (id.empty()) return;
    RunOne(id);
  }
}

/// Waits for a bake to run, and takes it: of the queued ones that with the highest priority, the oldest of
/// those. Empty: the service ends.
std::string BakeService::Next() {
  std::unique_lock lock(mutex_);
  for (;;) {
    if (ending_) return "";
    Slot* best = nullptr;
    const auto rank = [](const Slot& s) {
      return std::tuple(-s.status.entry.request.priority, s.status.entry.submitted_unix);
    };
    for (auto& [id, slot] : slots_) {
      if (slot.status.entry.state == BakeState::kQueued && (!best || rank(slot) < rank(*best))) best = &slot;
    }
    if (!best) {
      changed_.wait(lock);
      continue;
    }
    best->cancel = false;
    if (const Status noted = Change(best, BakeState::kRunning); noted.ok()) return best->status.entry.id;
    changed_.wait_for(lock, std::chrono::seconds(5));  // the journal cannot be written: a full disk may pass
  }
}

void BakeService::RunOne(const std::string& id) {
  const Result<BakeStatus> status = Get(id);
  if (!status.ok()) return;
  try {
    NoteEnd(id, Bake(status->entry.request, id).status());
  } catch (const std::bad_alloc&) {
    NoteEnd(id, LimitExceeded("out of memory; run fewer bakes at a time, or use a larger machine"));
  }
}

Result<BakeReport> BakeService::Bake(const BakeRequest& request, const std::string& id) {
  BakeOptions options;
  options.settings = request.settings;
  options.target = request.target;
  options.max_layers = request.max_layers;
  options.layer_tolerance = request.layer_tolerance;
  options.table_form = request.table_form;
  options.estimate_slices = request.estimate_slices;
  options.vertices_per_task = request.vertices_per_task;
  options.directions_per_task = request.directions_per_task;
  options.threads = options_.threads;
  const uint64_t memory = options_.memory_bytes ? options_.memory_bytes : UsableMemory() / 4;
  options.memory_bytes = std::max(memory / static_cast<uint64_t>(options_.running), uint64_t{1});
  options.work_dir = options_.store;
  if (options_.make_executor) options.make_executor = options_.make_executor(request);
  options.stop = [=, this] { return MustStop(id); };
  options.begins = [=, this](const Digest& bake_key) { NoteKey(id, bake_key); };

  NoteProgress(id, {"load"});
  GLINT_ASSIGN_OR_RETURN(std::vector<std::byte> bytes,
                         ReadFile(ScenePath(request.scene), options_.max_scene_bytes));
  // From memory: a file that a client sent names no other file.
  GLINT_ASSIGN_OR_RETURN(const Scene scene, LoadSceneFromMemory(bytes, request.name));
  bytes = {};
  return BakeScene(scene, request.name, ArchivePath(id), options,
                   [=, this](const BakeProgress& progress) { NoteProgress(id, progress); });
}

bool BakeService::MustStop(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto slot = slots_.find(id);
  return ending_ || slot == slots_.end() || slot->second.cancel;
}

void BakeService::NoteKey(const std::string& id, const Digest& bake_key) {
  const std::lock_guard lock(mutex_);
  Result<Slot*> slot = Find(id);
  if (!slot.ok()) return;
  (*slot)->status.entry.bake_key = bake_key.Hex();
  if (const Status noted = journal_.Put((*slot)->status.entry); !noted.ok())
    Log(LogLevel::kWarning, noted.message());  // only garbage collection would miss it
}

void BakeService::NoteProgress(const std::string& id, const BakeProgress& progress) {
  const std::lock_guard lock(mutex_);
  Result<Slot*> slot = Find(id);
  if (!slot.ok()) return;
  (*slot)->meter.Note(progress, &counts_);
  (*slot)->status.progress = progress;
  ++(*slot)->status.version;
  changed_.notify_all();
}

void BakeService::NoteEnd(const std::string& id, const Status& status) {
  const std::lock_guard lock(mutex_);
  Result<Slot*> found = Find(id);
  if (found.ok()) (*found)->meter.End(&counts_);
  // Stopped because the service ends: still running, as far as the journal goes.
  if (!found.ok() || (ending_ && status.kind() == ErrorKind::kInterrupted)) return;
  Slot* slot = *found;
  std::error_code error;
  if (status.ok()) slot->status.archive_bytes = fs::file_size(ArchivePath(id), error);
  const bool cancelled = status.kind() == ErrorKind::kInterrupted;
  const BakeState state = status.ok() ? BakeState::kDone
                          : cancelled ? BakeState::kCancelled
                                      : BakeState::kFailed;
  Log(status.ok() || cancelled ? LogLevel::kNote : LogLevel::kWarning,
      "bake " + id +
          (status.ok() ? " is done"
           : cancelled ? " is cancelled"
                       : " failed: " + status.message()),
      {{"bake", id}, {"bake_key", slot->status.entry.bake_key}});
  if (const Status noted = Change(slot, state, state == BakeState::kFailed ? status : Status()); !noted.ok())
    Log(LogLevel::kWarning, noted.message() + "; the next service takes the bake up again");
}

/// In memory and in the journal.
Status BakeService::Change(Slot* slot, BakeState state, Status error) {
  JournalEntry entry = slot->status.entry;
  entry.state = state;
  entry.error = std::move(error);
  Status noted = journal_.Put(entry);
  if (noted.ok() || HasEnded(state)) slot->status.entry = std::move(entry);
  ++slot->status.version;
  changed_.notify_all();
  return noted;
}

}  // namespace glint
