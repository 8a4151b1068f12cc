#include "tools/chart/chart.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/parallel.h"
#include "common/base/steady_clock.h"
#include "common/render/prefilter.h"
#include "common/scene/ray_scene.h"
#include "tools/chart/method.h"
#include "tools/chart/page.h"
#include "tools/chart/pareto.h"
#include "tools/chart/plot.h"
#include "tools/chart/tables.h"
#include "worker/execution_id.h"

namespace glint::chart {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

void HashVector(const glm::vec3& v, Hasher* hasher) { hasher->Add(v.x).Add(v.y).Add(v.z); }

/// What every picture of a chart depends on.
void HashSight(const Input& input, Hasher* hasher) {
  const View& view = input.view;
  hasher->String(ExecutionId()).Add(input.scene.content);
  HashVector(view.camera.eye, hasher);
  HashVector(view.camera.forward, hasher);
  HashVector(view.camera.up, hasher);
  hasher->Add(view.camera.vertical_fov).Add(view.width).Add(view.height);
  hasher->Add(view.environment_rotation_deg).Add(view.background);
  hasher->Add(input.environment.width()).Add(input.environment.height());
  hasher->Array(std::span(input.environment.texels()));
}

std::string UtcNow() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

/// The right to compute in a folder: two charts at once would spoil each other's seconds. Ends with the
/// process.
class FolderLock {
 public:
  static Result<FolderLock> Take(const fs::path& folder) {
    const fs::path path = folder / ".lock";
    FolderLock lock;
    lock.fd_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (lock.fd_ < 0) return IoError(path.string() + ": cannot create a file in this folder");
    if (flock(lock.fd_, LOCK_EX | LOCK_NB) != 0) {
      return IoError(folder.string() + ": another chart is being computed in this folder; wait for its end");
    }
    return lock;
  }
  FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  ~FolderLock() {
    if (fd_ >= 0) close(fd_);
  }

 private:
  FolderLock() = default;
  int fd_ = -1;
};

/// An empty folder for one piece of work, removed with all that is in it. What an interrupted bake left there
/// is not used: a bake that goes on would seem faster than it is.
class WorkFolder {
 public:
  static Result<std::unique_ptr<WorkFolder>> Make(const fs::path& path) {
    std::error_code error;
    fs::remove_all(path, error);
    GLINT_RETURN_IF_ERROR(CreateFolders(path));
    return std::unique_ptr<WorkFolder>(new WorkFolder(path));
  }
  ~WorkFolder() {
    std::error_code error;
    fs::remove_all(path_, error);
  }
  const fs::path& path() const { return path_; }

 private:
  explicit WorkFolder(fs::path path) : path_(std::move(path)) {}
  fs::path path_;
};

double Number(const Json& object, const char* name) {
  return object.contains(name) && object[name].is_number() ? object[name].get<double>() : 0;
}

Result<Record> TraceReference(const Input& input) {
  const RayScene rays(input.scene, input.threads);
  std::optional<BakeDomain> domain;
  if (input.reference.lobes) domain = BuildBakeDomain(input.scene, BrdfFitOptions{}, input.threads);
  ReferenceOptions options = input.reference;
  options.threads = input.threads;
  const Stopwatch watch;
  GLINT_ASSIGN_OR_RETURN(ReferenceResult result,
                         RenderReference(input.scene, rays, domain ? &*domain : nullptr, input.environment,
                                         input.view, options));
  const double seconds = watch.Seconds();
  return Record{Json{{"kind", "reference"},
                     {"seconds", seconds},
                     {"noise_rel_mse", result.noise_rel_mse},
                     {"noise_block4_rel_mse", result.noise_block4_rel_mse},
                     {"measured_at", UtcNow()}},
                std::move(result.picture)};
}

Result<MeasuredReference> GetReference(const Input& input, const RecordStore& store) {
  MeasuredReference reference;
  reference.key = ReferenceKey(input);
  std::optional<Record> record = store.Find(reference.key);
  reference.kept = record.has_value();
  if (!record) {
    Log(LogLevel::kProgress, "reference");
    GLINT_ASSIGN_OR_RETURN(record, TraceReference(input));
    GLINT_RETURN_IF_ERROR(store.Put(reference.key, *record));
  }
  reference.seconds = Number(record->numbers, "seconds");
  reference.noise = Number(record->numbers, "noise_rel_mse");
  reference.noise_blocks = Number(record->numbers, "noise_block4_rel_mse");
  reference.picture = std::move(record->picture);
  return reference;
}

Result<Record> RunPoint(const Task& task, const Point& point, const fs::path& folder) {
  const Method* const method = FindMethod(point.method);
  if (method == nullptr) return InternalError("no method called '" + point.method + "'");
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<WorkFolder> work, WorkFolder::Make(folder / "work"));
  GLINT_ASSIGN_OR_RETURN(Record record, method->run(task, point.settings, work->path()));
  record.numbers["kind"] = "point";
  record.numbers["method"] = point.method;
  for (const auto& [word, value] : point.values) record.numbers["settings"][word] = value;
  record.numbers["threads"] = task.threads;
  record.numbers["measured_at"] = UtcNow();
  return record;
}

Result<MeasuredPoint> Judge(const Input& input, const Point& point, Record record, const Picture& reference) {
  MeasuredPoint measured;
  measured.point = point;
  measured.seconds = Number(record.numbers, "seconds");
  measured.cpu_seconds = Number(record.numbers, "cpu_seconds");
  measured.bytes = Number(record.numbers, "bytes");
  measured.render_seconds = Number(record.numbers, "render_seconds");
  if (record.numbers.contains("measured_at")) measured.measured_at = record.numbers["measured_at"];
  measured.picture = std::move(record.picture);
  GLINT_ASSIGN_OR_RETURN(measured.blocks,
                         Compare(measured.picture, reference, {.block = kBlock, .tone = input.tone}));
  GLINT_ASSIGN_OR_RETURN(measured.pixels, Compare(measured.picture, reference, {.tone = input.tone}));
  return measured;
}

void MarkFronts(std::vector<MeasuredPoint>* points) {
  std::vector<CostError> seconds, bytes;
  for (const MeasuredPoint& p : *points) {
    seconds.push_back({p.seconds, p.blocks.rel_mse});
    bytes.push_back({p.bytes, p.blocks.rel_mse});
  }
  const std::vector<bool> on_seconds = ParetoFront(seconds), on_bytes = ParetoFront(bytes);
  for (size_t i = 0; i < points->size(); ++i) {
    (*points)[i].on_seconds_front = on_seconds[i];
    (*points)[i].on_bytes_front = on_bytes[i];
  }
}

/// The record of a point, from the store or computed; the prefilter is built when the first point needs it.
class PointSource {
 public:
  PointSource(const Input& input, const RecordStore& store, const fs::path& folder, int threads)
      : input_(input), store_(store), folder_(folder), threads_(threads) {}

  Result<Record> Get(const Digest& key, const Point& point, const std::string& progress, bool* kept) {
    std::optional<Record> record = store_.Find(key);
    *kept = record.has_value();
    if (record) return std::move(*record);
    if (StopRequested()) return Interrupted("stopped");
    Log(LogLevel::kProgress, progress);
    if (!prefiltered_) prefiltered_.emplace(input_.environment, threads_);
    const Task task{input_.scene, input_.environment, *prefiltered_, input_.view, input_.samples, threads_};
    Result<Record> computed = RunPoint(task, point, folder_);
    if (!computed.ok()) return computed.status().WithContext(point.name);
    GLINT_RETURN_IF_ERROR(store_.Put(key, *computed));
    return computed;
  }

 private:
  const Input& input_;
  const RecordStore& store_;
  fs::path folder_;
  int threads_;
  std::optional<PrefilteredEnvironment> prefiltered_;
};

/// Says how far an interrupted chart came.
Status WithProgress(const Status& status, size_t done, size_t points) {
  if (status.kind() != ErrorKind::kInterrupted) return status;
  return Interrupted("interrupted: " + std::to_string(done) + " of " + std::to_string(points) +
                     " points are kept; the same command goes on with the others");
}

Status PublishText(const fs::path& path, const std::string& text) {
  return PublishFile(path, std::as_bytes(std::span(text)));
}

PlotInput MakePlot(const Input& input, const Measured& measured, bool over_bytes) {
  PlotInput plot;
  plot.name = over_bytes ? "error_over_bytes" : "error_over_seconds";
  plot.title = input.scene_name + ", " + input.environment_name;
  plot.cost_label = over_bytes ? "archive, MB"
                               : "bake, s (" + std::to_string(measured.threads) +
                                     (measured.threads == 1 ? " thread)" : " threads)");
  plot.error_label = "relMSE, 4 x 4 blocks";
  plot.noise = measured.reference.noise_blocks;
  for (const MeasuredPoint& p : measured.points) {
    plot.points.push_back({p.point.name, p.point.method, over_bytes ? 1e-6 * p.bytes : p.seconds,
                           p.blocks.rel_mse, over_bytes ? p.on_bytes_front : p.on_seconds_front});
  }
  return plot;
}

/// Draws both plots and puts their files in place.
Status DrawAndPublish(const Input& input, const Measured& measured, const fs::path& folder,
                      const std::string& gnuplot, PagePlots* page) {
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<WorkFolder> work, WorkFolder::Make(folder / "plot-work"));
  for (const bool over_bytes : {false, true}) {
    const PlotInput plot = MakePlot(input, measured, over_bytes);
    GLINT_ASSIGN_OR_RETURN(const PlotFiles files, DrawPlot(plot, work->path(), gnuplot));
    GLINT_RETURN_IF_ERROR(PublishText(folder / (plot.name + ".svg"), files.svg));
    GLINT_RETURN_IF_ERROR(PublishText(folder / (plot.name + ".png"), files.png));
    (over_bytes ? page->bytes_svg : page->seconds_svg) = files.svg;
  }
  return {};
}

void RemovePlots(const fs::path& folder) {
  for (const char* name : {"error_over_seconds", "error_over_bytes"}) {
    for (const char* extension : {".svg", ".png"}) {
      std::error_code error;
      fs::remove(folder / (std::string(name) + extension), error);
    }
  }
}

}  // namespace

Digest PointKey(const Input& input, const Point& point) {
  Hasher hasher;
  hasher.String("glint chart point").Add(1).String(point.method);
  HashSight(input, &hasher);
  hasher.Add(ResolveThreadCount(input.threads)).Add(input.samples);
  if (const Method* method = FindMethod(point.method)) method->hash(point.settings, &hasher);
  return hasher.Finish();
}

Digest ReferenceKey(const Input& input) {
  const ReferenceOptions& r = input.reference;
  Hasher hasher;
  hasher.String("glint chart reference").Add(1);
  HashSight(input, &hasher);
  hasher.Add(r.bounces).Add(r.first_bounce).Add(r.samples).Add(r.seed).Add(r.lobes);
  hasher.Add(r.environment_sampling);
  return hasher.Finish();
}

Result<Measured> Measure(const Input& input, const std::vector<Point>& points, const fs::path& folder) {
  GLINT_ASSIGN_OR_RETURN(const RecordStore store, RecordStore::Open(folder / "points"));
  GLINT_ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::Take(folder));
  Measured measured;
  measured.threads = ResolveThreadCount(input.threads);
  Result<MeasuredReference> reference = GetReference(input, store);
  if (!reference.ok()) return WithProgress(reference.status(), 0, points.size());
  measured.reference = std::move(reference).value();

  PointSource source(input, store, folder, measured.threads);
  for (const Point& point : points) {
    const size_t done = measured.points.size();
    const std::string progress =
        "point " + std::to_string(done + 1) + " of " + std::to_string(points.size()) + ": " + point.name;
    const Digest key = PointKey(input, point);
    bool kept = false;
    Result<Record> record = source.Get(key, point, progress, &kept);
    if (!record.ok()) return WithProgress(record.status(), done, points.size());
    GLINT_ASSIGN_OR_RETURN(MeasuredPoint judged,
                           Judge(input, point, std::move(record).value(), measured.reference.picture));
    judged.key = key;
    judged.kept = kept;
    measured.points.push_back(std::move(judged));
  }
  MarkFronts(&measured.points);
  return measured;
}

Status Publish(const Input& input, const Measured& measured, const fs::path& folder,
               const std::string& gnuplot) {
  GLINT_RETURN_IF_ERROR(PublishText(folder / "chart.csv", ChartCsv(measured)));
  GLINT_RETURN_IF_ERROR(PublishText(folder / "chart.json", ChartJson(input, measured).dump(2) + "\n"));
  PagePlots plots;
  Status drawn = DrawAndPublish(input, measured, folder, gnuplot, &plots);
  if (!drawn.ok()) {
    RemovePlots(folder);
    plots = {};
  }
  GLINT_ASSIGN_OR_RETURN(const std::string page, ChartPage(input, measured, plots));
  GLINT_RETURN_IF_ERROR(PublishText(folder / "index.html", page));
  return drawn;
}

}  // namespace glint::chart
