#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/archive/slice_table.h"
#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/domain/bake_settings.h"
#include "common/scene/load.h"
#include "coordinator/error_estimate.h"
#include "coordinator/executor.h"
#include "coordinator/spatial/refine.h"

namespace glint {

/// Layers of an archive, less the direct one.
inline constexpr int kMaxIndirectLayers = 255;

/// Parts of a bake that can be made finer one by one.
enum class BakeAxis : uint8_t { kVertices, kDirections, kRays, kLobes, kBits };
inline constexpr int kBakeAxes = 5;
inline constexpr std::array<const char*, kBakeAxes> kBakeAxisNames = {"vertices", "directions", "rays",
                                                                      "lobes", "bits"};

inline constexpr double kMaxTargetSeconds = 1e9;

/// What a bake is to reach and may take, in place of settings: bake_target.h.
struct BakeTarget {
  float tolerance = 0;     ///< ErrorSummary::rms of all layers to get to; 0: as low as time and bytes allow
  double max_seconds = 0;  ///< wall time, of rounds of earlier runs too; 0: any
  uint64_t max_bytes = 0;  ///< of the archive; 0: any
  std::array<bool, kBakeAxes> fixed{};  ///< axes that stay as the settings have them

  bool active() const { return tolerance > 0 || max_seconds > 0 || max_bytes > 0; }
};

/// How to bake. `settings`, the layers, the form and the estimate decide the result; the rest only how it is
/// reached.
struct BakeOptions {
  BakeSettings settings;
  BakeTarget target;              ///< if active, settings are found, from these on
  int max_layers = 16;            ///< at most this many indirect layers, 0 to kMaxIndirectLayers, ...
  float layer_tolerance = 0.01f;  ///< ... and no more once a layer's relative light is below this
  TableForm table_form = kDefaultTableForm;
  /// Slices tested after the bake to estimate its error: 0: no estimate; none: DefaultEstimateSlices
  std::optional<uint32_t> estimate_slices;
  SceneLimits scene_limits;
  int threads = 0;                   ///< 0: all cores
  uint32_t vertices_per_task = 0;    ///< 0: chosen so that tasks are neither tiny nor few
  uint32_t directions_per_task = 0;  ///< 0: all
  uint64_t memory_bytes = 0;         ///< for hit sets kept between layers; 0: a quarter of UsableMemory()
  std::filesystem::path
      work_dir;                   ///< for a sub-folder with finished tasks; empty: OUT.work beside the output
  bool keep_work = false;         ///< keep that sub-folder after the archive is written
  ExecutorFactory make_executor;  ///< who runs the tasks; empty: threads of this process
  std::function<bool()> stop = StopRequested;  ///< asked between tasks: whether to end (kInterrupted)
  /// Told the key of every bake that begins: that of its folder of finished tasks. With a target there are
  /// several.
  std::function<void(const Digest&)> begins;
};

/// What one of a queue's workers has done in a layer.
struct WorkerProgress {
  std::string name;    ///< HomeName, or "line <number>"
  uint64_t tasks = 0;  ///< finished since the layer began in this run
  double seconds = 0;  ///< of processor time that they took
};

/// State of a running bake.
struct BakeProgress {
  std::string stage;  ///< "load", "fit", "place", "layer 0", ..., "estimate", "write"
  size_t done = 0, tasks = 0;
  size_t found = 0;   ///< of those done: their result was there
  uint64_t rays = 0;  ///< of the layers that are merged
  double slices_per_second = 0;
  double seconds_left = 0;                ///< of this layer; 0: not known yet
  std::vector<WorkerProgress> workers{};  ///< in the order of their first tasks; none without a queue
};
using BakeProgressCallback = std::function<void(const BakeProgress&)>;

struct LayerReport {
  uint64_t slices = 0;
  std::array<uint64_t, kMaxSliceLobes> stored{};  ///< slices with at least 1, 2, ... lobes
  double density = 0;                             ///< stored / all entries of the first lobes' tables
  double energy = 0;                              ///< relative light (Layer::energy)
};

/// What a bake did. The deterministic part goes into the archive, all of it into the JSON beside it.
struct BakeReport {
  std::string scene;
  Digest archive_key;
  uint64_t vertices = 0, triangles = 0, directions = 0, rays = 0;
  uint64_t baked_vertices = 0;
  std::optional<RefinementReport> refinement;  ///< none if all of the mesh's vertices are baked
  std::vector<LayerReport> layers;
  std::optional<ErrorEstimate> error;  ///< none if not asked for
  bool complete = false;               ///< no further layer carries the tolerance's part of the light
  std::vector<std::pair<std::string, double>> stage_seconds;  ///< of this run; a stage may come twice
  double seconds = 0;                                         ///< of this run
  uint64_t archive_bytes = 0, tasks = 0, tasks_reused = 0;
  std::vector<std::string> notes;
  std::string execution;  ///< ExecutionId()
  std::string deterministic_json, json;
};

/// Bakes a scene file into an archive: load, fit, place vertices, direct and indirect layers, merge,
/// estimate, write. Stopped by a signal (kInterrupted) or killed at any moment, the same call goes on where
/// it was. With a target, of the report there are only JSON, key, bytes and seconds. Errors: those of
/// LoadScene and RefineToTarget; kUsage for max_layers; kIo for the output or the work folder; kInterrupted.
Result<BakeReport> Bake(const std::filesystem::path& scene_path, const std::filesystem::path& out_path,
                        const BakeOptions& options, const BakeProgressCallback& progress = {});

/// The same for a scene in memory; `name` appears in messages and the report. kBadInput: more than three
/// vertices a triangle.
Result<BakeReport> BakeScene(const Scene& scene, const std::string& name,
                             const std::filesystem::path& out_path, const BakeOptions& options,
                             const BakeProgressCallback& progress = {});

}  // namespace glint
