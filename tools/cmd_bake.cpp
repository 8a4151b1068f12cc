#include <unistd.h>

#include <cstdio>
#include <memory>

#include "common/base/log.h"
#include "common/base/steady_clock.h"
#include "common/queue/nats_queue.h"
#include "coordinator/bake.h"
#include "coordinator/cluster_executor.h"
#include "coordinator/manual_executor.h"
#include "tools/bake_words.h"
#include "tools/commands.h"
#include "tools/report.h"
#include "tools/service_words.h"

namespace glint {
namespace {

/// Who runs tasks.
enum class Executing { kLocal, kManual, kCluster };

struct BakeWords {
  std::string scene, output;
  uint64_t memory_mib = 0;
  Executing executing = Executing::kLocal;
  NatsOptions nats;
  ClusterOptions cluster;
  BakeOptions options;
};

/// Shows each new stage at once, and what happens inside it at a pace that a person or a log file can take.
class ProgressPrinter {
 public:
  void operator()(const BakeProgress& progress) {
    const bool new_stage = progress.stage != stage_;
    if (!new_stage && watch_.Seconds() < next_) return;
    stage_ = progress.stage;
    next_ = watch_.Seconds() + (isatty(STDERR_FILENO) == 1 ? 0.1 : 10.0);
    Log(LogLevel::kProgress, Describe(progress));
  }

 private:
  static std::string Describe(const BakeProgress& progress) {
    if (progress.tasks == 0) return progress.stage;
    char text[160];
    const double percent = 100.0 * static_cast<double>(progress.done) / static_cast<double>(progress.tasks);
    if (progress.seconds_left <= 0) {
      std::snprintf(text, sizeof text, "%s: %3.0f %%", progress.stage.c_str(), percent);
    } else {
      std::snprintf(text, sizeof text, "%s: %3.0f %%, %.3g million slices/s, %.0f s left",
                    progress.stage.c_str(), percent, 1e-6 * progress.slices_per_second,
                    progress.seconds_left);
    }
    return text;
  }

  Stopwatch watch_;
  std::string stage_;
  double next_ = 0;
};

void NoteTarget(const nlohmann::ordered_json& target) {
  const bool reached = target["reached"].get<bool>();
  Log(reached ? LogLevel::kNote : LogLevel::kWarning,
      (reached ? "done: " : "not all that was asked for: ") + target["ended"].get<std::string>() + " (" +
          std::to_string(target["rounds"].size()) + " rounds)");
}

Status RunBake(const BakeWords& words, const CommonWords& common) {
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output, {".glint"}));
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output + ".json", {".json"}));
  BakeOptions options = words.options;
  options.threads = common.threads;
  options.memory_bytes = words.memory_mib << 20;

  std::unique_ptr<NatsQueue> queue;
  if (words.executing == Executing::kManual) options.make_executor = MakeManualExecutor;
  if (words.executing == Executing::kCluster) {
    GLINT_ASSIGN_OR_RETURN(queue, NatsQueue::Connect(words.nats));
    options.make_executor = MakeClusterExecutor(queue.get(), words.cluster);
  }
  ProgressPrinter printer;
  Result<BakeReport> baked = Bake(words.scene, words.output, options,
                                  [&printer](const BakeProgress& progress) { printer(progress); });
  if (baked.status().kind() == ErrorKind::kInterrupted)
    return Interrupted(baked.status().message() + "; run the same command again to go on");
  GLINT_ASSIGN_OR_RETURN(const BakeReport report, std::move(baked));
  const auto full = nlohmann::ordered_json::parse(report.json);
  for (const auto& note : full["notes"]) Log(LogLevel::kNote, words.scene + ": " + note.get<std::string>());
  char summary[160];
  std::snprintf(summary, sizeof summary,
                "%zu layers of %llu baked vertices x %llu directions, %.1f MB, in %.1f s",
                full["layers"].size(), full["baked_vertices"].get<unsigned long long>(),
                full["directions"].get<unsigned long long>(),
                1e-6 * static_cast<double>(report.archive_bytes), report.seconds);
  Log(LogLevel::kNote, "wrote " + words.output + " and " + words.output + ".json (" + summary + ")");
  if (full.contains("error"))
    Log(LogLevel::kNote, "relative error of relit pictures: " + ErrorLine(full["error"]));
  if (full.contains("target")) NoteTarget(full["target"]);
  if (common.json) PrintJson(full);
  return {};
}

void AddMachineWords(CLI::App& app, BakeWords& words) {
  BakeOptions& options = words.options;
  const std::string group = "Machine";
  app.add_option(
         "--work-dir", options.work_dir,
         "Folder for finished tasks, in a sub-folder of the bake's own (default: OUT.work beside the output)")
      ->type_name("FOLDER")
      ->group(group);
  app.add_flag("--keep-work", options.keep_work, "Keep that sub-folder after the archive is written")
      ->group(group);
  app.add_option("--memory", words.memory_mib,
                 "MiB for hits kept between layers; 0: a quarter of what it may use")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1} << 32))
      ->type_name("MIB")
      ->group(group);
  AddChoice<Executing>(
      app, "--executor", words.executing,
      {{"local", Executing::kLocal}, {"manual", Executing::kManual}, {"cluster", Executing::kCluster}},
      "Who runs tasks: local (default): this process; manual: 'glint run-task'; cluster: workers")
      ->group(group);
}

}  // namespace

Command AddBakeCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("bake", "Bake a scene's light transport into an archive");
  const auto words = std::make_shared<BakeWords>();
  app.add_option("scene", words->scene, "Scene: glTF 2.0, .glb or .gltf")->required()->type_name("SCENE");
  app.add_option("-o,--output", words->output, "Archive to write; the report goes to OUT.glint.json")
      ->required()
      ->type_name("OUT.glint");
  AddAccuracyWords(app, words->options);
  AddMachineWords(app, *words);
  AddTaskWords(app, words->options);
  AddNatsWords(app, words->nats);
  AddReplicasWord(app, words->nats);
  AddPriorityWord(app, words->cluster);
  AddLeaseWord(app, words->cluster);
  AddCommonWords(app, common);
  app.footer(
      "Interrupted (Ctrl-C) or killed, the same command goes on where it was: finished tasks are in the work "
      "folder.\n"
      "\n"
      "Examples:\n"
      "  glint bake teapot.glb -o teapot.glint\n"
      "  glint bake teapot.glb -o teapot.glint --layers 2 --directions 2562 --threads 4\n"
      "  glint bake teapot.glb -o teapot.glint --tolerance 0.1\n"
      "  glint bake teapot.glb -o teapot.glint --max-seconds 60 --max-bytes 50MB\n"
      "  glint bake teapot.glb -o paper.glint --gather paper\n"
      "  glint bake teapot.glb -o teapot.glint --executor cluster --work-dir /shared/bakes --nats "
      "nats://queue:4222");
  return [words, &common] { return RunBake(*words, common); };
}

}  // namespace glint
