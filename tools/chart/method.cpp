#include "tools/chart/method.h"

#include <sys/resource.h>

#include <utility>

#include "common/archive/archive.h"
#include "common/base/steady_clock.h"
#include "common/render/archive_renderer.h"
#include "coordinator/bake.h"

namespace glint::chart {
namespace {

void HashBake(const Settings& settings, Hasher* hasher) {
  HashSettings(settings.bake.settings, hasher);
  hasher->Add(settings.bake.max_layers).Add(settings.bake.layer_tolerance).Add(settings.bake.table_form);
  hasher->Add(settings.bake.target.tolerance);
}

/// Processor seconds of this process so far, all threads.
double ProcessorSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

template <GatherMethod kGather>
void HashGather(const Settings& settings, Hasher* hasher) {
  Settings own = settings;
  own.bake.settings.method = kGather;
  HashBake(own, hasher);
}

template <GatherMethod kGather>
Result<Record> BakeAndRender(const Task& task, const Settings& settings, const std::filesystem::path& work) {
  BakeOptions options = settings.bake;
  options.settings.method = kGather;
  if (!options.target.active()) options.estimate_slices = 0;  // a point's error is measured
  options.threads = task.threads;
  const std::filesystem::path path = work / "point.glint";
  const double cpu_begin = ProcessorSeconds();
  GLINT_ASSIGN_OR_RETURN(const BakeReport report, BakeScene(task.scene, "scene", path, options));
  const double cpu_seconds = ProcessorSeconds() - cpu_begin;
  GLINT_ASSIGN_OR_RETURN(const Archive archive, Archive::Open(path));

  ArchiveRenderer renderer(archive, task.prefiltered, {.samples = task.samples, .threads = task.threads});
  const Stopwatch watch;
  GLINT_ASSIGN_OR_RETURN(Picture picture, renderer.Render(task.view));
  const double render_seconds = watch.Seconds();
  return Record{{{"seconds", report.seconds},
                 {"cpu_seconds", cpu_seconds},
                 {"bytes", report.archive_bytes},
                 {"render_seconds", render_seconds},
                 {"bake_report", nlohmann::ordered_json::parse(report.json, nullptr, false)}},
                std::move(picture)};
}

template <GatherMethod kGather>
Method BakeMethod(const char* name, const char* help) {
  return {name, help, HashGather<kGather>, BakeAndRender<kGather>};
}

}  // namespace

const std::vector<Method>& Methods() {
  static const std::vector<Method> methods{
      BakeMethod<GatherMethod::kShared>("shared", "one set of rays per vertex"),
      BakeMethod<GatherMethod::kPaper>("paper", "the 2011 scheme"),
  };
  return methods;
}

std::vector<std::string> MethodNames() {
  std::vector<std::string> names;
  for (const Method& method : Methods()) names.push_back(method.name);
  return names;
}

const Method* FindMethod(const std::string& name) {
  for (const Method& method : Methods()) {
    if (method.name == name) return &method;
  }
  return nullptr;
}

}  // namespace glint::chart
