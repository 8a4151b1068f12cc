#include "coordinator/bake.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <utility>

#include "common/archive/archive.h"
#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/memory.h"
#include "common/base/parallel.h"
#include "common/base/steady_clock.h"
#include "common/domain/bake_domain.h"
#include "common/domain/direction_grid.h"
#include "common/round/task.h"
#include "common/scene/ray_scene.h"
#include "coordinator/bake_report.h"
#include "coordinator/bake_target.h"
#include "coordinator/layer.h"
#include "coordinator/local_executor.h"
#include "coordinator/round_plan.h"
#include "coordinator/spatial/refine.h"
#include "coordinator/work_folder.h"
#include "worker/execution_id.h"
#include "worker/home_line.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

/// Slices that the report's estimate tests.
uint32_t EstimateSlices(const BakeOptions& options, const Scene& scene) {
  return options.estimate_slices.value_or(
      DefaultEstimateSlices(static_cast<uint32_t>(scene.positions.size())));
}

/// The bake's key, and what decides which of its layers the archive holds, in which form, beside what else:
/// the report with its estimate of the error is in it, too.
Digest ArchiveKey(const Digest& bake_key, const Scene& scene, const std::string& name,
                  const BakeOptions& options) {
  Hasher hasher;
  hasher.String("glint archive").Add(bake_key).String(name);
  hasher.Add(options.max_layers).Add(options.layer_tolerance).Add(options.table_form);
  hasher.Add(kEstimateRevision).Add(EstimateSlices(options, scene));
  hasher.Add(uint64_t{scene.cameras.size()});
  for (const Camera& camera : scene.cameras) {
    hasher.String(camera.name).Add(camera.vertical_fov);
    for (const glm::vec3& v : {camera.eye, camera.forward, camera.up}) hasher.Add(v.x).Add(v.y).Add(v.z);
  }
  hasher.Add(uint64_t{scene.notes.size()});
  for (const std::string& note : scene.notes) hasher.String(note);
  return hasher.Finish();
}

/// Measures stages and passes progress on.
class Progress {
 public:
  Progress(const BakeProgressCallback& callback, BakeReport* report) : callback_(callback), report_(report) {}

  void Stage(const std::string& name, size_t tasks = 0, double slices_per_task = 0) {
    EndStage();
    state_ = {name, 0, tasks};
    workers_.clear();
    slices_per_task_ = slices_per_task;
    computed_ = 0;
    begin_ = SteadySeconds();
    Emit();
  }
  /// @param again  the round is run once more, to mend chunks that were there but damaged
  void TaskDone(bool was_there, bool again) {
    ++state_.done;
    state_.found += was_there;
    computed_ += !was_there;
    if (!again) {
      ++report_->tasks;
      report_->tasks_reused += was_there;
    } else if (!was_there && report_->tasks_reused > 0) {
      --report_->tasks_reused;
    }
    const double seconds = std::max(SteadySeconds() - begin_, 1e-6);
    state_.slices_per_second = static_cast<double>(computed_) * slices_per_task_ / seconds;
    state_.seconds_left =
        computed_ ? seconds / static_cast<double>(computed_) * static_cast<double>(state_.tasks - state_.done)
                  : 0;
    Emit();
  }
  /// Says who finished a task, before TaskDone does.
  void Credit(const ChunkStore& store, const TaskNote& note) {
    if (!note.home) return;
    const auto [place, is_new] = workers_.try_emplace(*note.home, state_.workers.size());
    if (is_new) {
      const std::string name = HomeName(store.root(), *note.home);
      state_.workers.push_back({name.empty() ? "line " + std::to_string(*note.home) : name});
    }
    WorkerProgress& worker = state_.workers[place->second];
    ++worker.tasks;
    worker.seconds += note.seconds;
  }
  void EndStage() {
    if (!state_.stage.empty()) report_->stage_seconds.emplace_back(state_.stage, SteadySeconds() - begin_);
    state_.stage.clear();
  }

 private:
  void Emit() {
    state_.rays = report_->rays;
    if (callback_) callback_(state_);
  }
  const BakeProgressCallback& callback_;
  BakeReport* report_;
  BakeProgress state_;
  std::map<uint32_t, size_t> workers_;  ///< places in state_.workers, by line
  double begin_ = 0, slices_per_task_ = 0;
  size_t computed_ = 0;
};

/// Runs one layer's round and merges it. Chunks found damaged on merging are computed again, once.
Result<Layer> BakeLayer(const std::vector<TaskSpec>& tasks, const Layer* previous, ChunkStore& store,
                        const BakeDomain& domain, const DirectionGrid& grid, const BakeOptions& options,
                        int threads, Executor* executor, Progress* progress) {
  const std::string name = "layer " + std::to_string(tasks.front().layer);
  const double slices_per_task = 0.5 * static_cast<double>(domain.row_count()) * grid.size() *
                                 domain.max_lobes() / static_cast<double>(tasks.size());
  for (int attempt = 0;; ++attempt) {
    progress->Stage(name, tasks.size(), slices_per_task);
    GLINT_RETURN_IF_ERROR(executor->Run({tasks, previous}, [&](size_t i, bool was_there) {
      if (!was_there) progress->Credit(store, store.FindNote(tasks[i].key).value_or(TaskNote()));
      progress->TaskDone(was_there, attempt > 0);
    }));
    progress->Stage("merge " + std::to_string(tasks.front().layer));
    Result<Layer> layer =
        MergeLayer(store, tasks, domain, grid, options.settings, options.table_form, threads);
    if (layer.ok() || layer.status().kind() != ErrorKind::kMismatch || attempt > 0) return layer;
    Log(LogLevel::kWarning, layer.status().message());
  }
}

LayerReport DescribeLayer(const Layer& layer) {
  LayerReport report{layer.counters.slices, layer.stored, 0, layer.energy};
  double cells = static_cast<double>(layer.views.diffuse.rows()) * layer.views.diffuse.columns();
  for (const SliceTableView& t : layer.views.specular) cells += static_cast<double>(t.rows()) * t.columns();
  report.density = cells > 0 ? static_cast<double>(layer.stored[0]) / cells : 0;
  return report;
}

Status Publish(const fs::path& out_path, const Scene& scene, const BakeDomain& domain,
               const std::deque<Layer>& layers, const BakeOptions& options, BakeReport* report) {
  ArchiveContent content;
  content.domain = &domain;
  content.cameras = scene.cameras;
  content.grid_level = options.settings.grid_level;
  content.base_level = options.settings.BaseLevel();
  content.slice_lobes = static_cast<int>(options.settings.StoredLobes());
  content.archive_key = report->archive_key;
  for (const Layer& layer : layers) {
    content.layers.push_back(layer.views);
    content.layer_bytes.emplace_back(layer.slots.begin(), layer.slots.end());
  }
  report->deterministic_json = DeterministicReportJson(*report, domain, options);
  content.report_json = report->deterministic_json;
  return WriteArchive(out_path, content);
}

Result<ErrorEstimate> Estimate(const BakeDomain& domain, const DirectionGrid& grid,
                               const std::deque<Layer>& layers, const BakeOptions& options, uint32_t slices,
                               int threads) {
  // By one thread: the order of a tree's leaves may depend on how many build it, and this is in the archive.
  const RayScene rays(domain.positions, domain.triangles, 1);
  GLINT_RETURN_IF_ERROR(rays.status());
  std::vector<LayerViews> views;
  views.reserve(layers.size());
  for (const Layer& layer : layers) views.push_back(layer.views);
  return EstimateError(domain, rays, grid, views,
                       {slices, options.settings.seed, options.settings.read_out(), threads});
}

/// Notes about input that refinement left alone.
void Describe(const RefinementReport& refinement, std::vector<std::string>* notes) {
  if (refinement.degenerate > 0)
    notes->push_back(std::to_string(refinement.degenerate) +
                     " triangles have two corners in one place; refinement passed them over");
  if (refinement.non_manifold > 0)
    notes->push_back(std::to_string(refinement.non_manifold) +
                     " triangles do not join up with those around them (edges of three or more, or turned "
                     "inside out); all of their vertices are baked");
}

/// Decides where transfer is known; every vertex of the mesh where the settings say nothing.
Status PlaceVertices(const BakeSettings& settings, int threads, BakeDomain* domain, BakeReport* report) {
  if (settings.subdivide > 0) GLINT_RETURN_IF_ERROR(SubdivideEvenly(settings.subdivide, domain));
  if (settings.spatial_tolerance > 0) {
    GLINT_ASSIGN_OR_RETURN(report->refinement, RefineVertices(settings, threads, domain));
    Describe(*report->refinement, &report->notes);
  }
  report->baked_vertices = domain->row_count();
  return {};
}

/// An archive's geometry holds at most three vertices a triangle. Scenes from files have no others.
Status CheckVertices(const Scene& scene, const std::string& name) {
  if (scene.positions.size() <= 3 * scene.triangles.size()) return {};
  return BadInput(name + ": " + std::to_string(scene.positions.size()) + " vertices, more than its " +
                  std::to_string(scene.triangles.size()) +
                  " triangles can use; leave out those that no triangle uses");
}

/// @param begin, loaded  when the bake began, and when the scene was there
Result<BakeReport> BakeLoaded(const Scene& scene, const std::string& name, const fs::path& out_path,
                              const BakeOptions& options, const BakeProgressCallback& callback, double begin,
                              double loaded) {
  if (options.max_layers < 0 || options.max_layers > kMaxIndirectLayers) {
    return UsageError("indirect layers: " + std::to_string(options.max_layers) + " is not 0 to " +
                      std::to_string(kMaxIndirectLayers));
  }
  if (options.settings.spatial_tolerance > 0 && options.settings.subdivide > 0)
    return UsageError("faces are either subdivided evenly or refined up to a tolerance: choose one");
  GLINT_RETURN_IF_ERROR(CheckVertices(scene, name));
  const int threads = ResolveThreadCount(options.threads);
  const Digest bake_key = BakeKey(ExecutionId(), scene.content, options.settings);
  if (options.begins) options.begins(bake_key);
  const fs::path work_dir =
      options.work_dir.empty() ? fs::path(out_path.string() + ".work") : options.work_dir;
  GLINT_ASSIGN_OR_RETURN(WorkFolder work, WorkFolder::Open(work_dir, bake_key));
  BakeReport report;
  report.scene = name;
  report.archive_key = ArchiveKey(bake_key, scene, name, options);
  report.notes = scene.notes;
  report.execution = ExecutionId();
  if (loaded > begin) report.stage_seconds.emplace_back("load", loaded - begin);
  Progress progress(callback, &report);

  progress.Stage("fit");
  BakeDomain domain = BuildBakeDomain(scene, options.settings.fit, threads);
  report.notes.insert(report.notes.end(), domain.notes.begin(), domain.notes.end());
  const DirectionGrid grid(options.settings.grid_level, options.settings.BaseLevel());
  report.vertices = domain.vertex_count();
  report.triangles = domain.triangles.size();
  report.directions = grid.size();
  progress.Stage("place");
  GLINT_RETURN_IF_ERROR(PlaceVertices(options.settings, threads, &domain, &report));

  const uint64_t memory = options.memory_bytes ? options.memory_bytes : UsableMemory() / 4;
  const auto make_executor = options.make_executor ? options.make_executor : MakeLocalExecutor;
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<Executor> executor,
                         make_executor({scene.content, domain, grid, options.settings, work.store(), threads,
                                        memory, options.stop}));

  const PlanInput plan{
      scene.content, domain, grid, options.settings, options.vertices_per_task, options.directions_per_task,
      work.store()};
  std::deque<Layer> layers;
  std::vector<TaskSpec> tasks;
  for (int index = 0; index <= options.max_layers; ++index) {
    const Digest previous = layers.empty() ? Digest{} : layers.back().digest;
    GLINT_ASSIGN_OR_RETURN(tasks, PlanRound(plan, index, previous, tasks));
    GLINT_ASSIGN_OR_RETURN(
        Layer layer, BakeLayer(tasks, layers.empty() ? nullptr : &layers.back(), work.store(), domain, grid,
                               options, threads, executor.get(), &progress));
    report.layers.push_back(DescribeLayer(layer));
    report.rays += layer.counters.rays;
    const bool faint = index > 0 && layer.energy < options.layer_tolerance;
    report.complete = faint || (index > 0 && layer.stored[0] == 0);  // what reflects nothing sends on nothing
    layers.push_back(std::move(layer));
    if (faint) break;
  }

  if (const uint32_t slices = EstimateSlices(options, scene)) {
    progress.Stage("estimate");
    GLINT_ASSIGN_OR_RETURN(report.error, Estimate(domain, grid, layers, options, slices, threads));
  }
  progress.Stage("write");
  GLINT_RETURN_IF_ERROR(Publish(out_path, scene, domain, layers, options, &report));
  progress.EndStage();
  std::error_code error;
  report.archive_bytes = fs::file_size(out_path, error);
  report.seconds = SteadySeconds() - begin;
  report.json = FullReportJson(report);
  GLINT_RETURN_IF_ERROR(PublishFile(out_path.string() + ".json", std::as_bytes(std::span(report.json))));
  if (!options.keep_work) {
    // It can be large, and serves nobody any more; but the bake has not failed if it stays.
    // A folder that was named for others to share is where workers wait for the next bake.
    const bool shared = !options.work_dir.empty() && options.make_executor;
    if (const Status removed = work.Remove(!shared); !removed.ok())
      Log(LogLevel::kWarning, removed.message());
  }
  return report;
}

/// One bake with the options' settings or, with a target, as many as that takes.
Result<BakeReport> BakeOrRefine(const Scene& scene, const std::string& name, const fs::path& out_path,
                                const BakeOptions& options, const BakeProgressCallback& callback,
                                double begin, double loaded) {
  if (!options.target.active()) return BakeLoaded(scene, name, out_path, options, callback, begin, loaded);
  Hasher hasher;
  hasher.String("glint target")
      .Add(ArchiveKey(BakeKey(ExecutionId(), scene.content, options.settings), scene, name, options));
  hasher.Add(options.target.tolerance);
  for (const bool fixed : options.target.fixed) hasher.Add(fixed);
  return RefineToTarget(hasher.Finish(), out_path, options,
                        [&](const BakeOptions& round, const fs::path& path) {
                          const double now = SteadySeconds();
                          return BakeLoaded(scene, name, path, round, callback, now, now);
                        });
}

}  // namespace

Result<BakeReport> BakeScene(const Scene& scene, const std::string& name, const fs::path& out_path,
                             const BakeOptions& options, const BakeProgressCallback& callback) {
  const double begin = SteadySeconds();
  return BakeOrRefine(scene, name, out_path, options, callback, begin, begin);
}

Result<BakeReport> Bake(const fs::path& scene_path, const fs::path& out_path, const BakeOptions& options,
                        const BakeProgressCallback& progress) {
  const double begin = SteadySeconds();
  if (progress) progress({"load", 0, 0, 0, 0});
  GLINT_ASSIGN_OR_RETURN(const Scene scene, LoadScene(scene_path, options.scene_limits));
  return BakeOrRefine(scene, scene_path.filename().string(), out_path, options, progress, begin,
                      SteadySeconds());
}

}  // namespace glint
