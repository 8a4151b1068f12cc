#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/render/prefilter.h"
#include "common/render/view.h"
#include "common/scene/scene.h"
#include "tools/chart/record.h"
#include "tools/chart/sweep.h"

namespace glint::chart {

/// What every method works on.
struct Task {
  const Scene& scene;
  const Environment& environment;
  const PrefilteredEnvironment& prefiltered;
  View view;
  int samples = 4;  ///< camera rays per pixel
  int threads = 1;  ///< resolved: at least 1
};

/// One way to get a picture from a scene by work done ahead.
struct Method {
  std::string name;  ///< of --gather
  std::string help;
  /// Feeds the settings that its results depend on.
  void (*hash)(const Settings& settings, Hasher* hasher);
  /// Does the work ahead in `work`, an empty folder that is removed afterwards, and renders the view.
  /// Numbers: "seconds" of the work ahead alone, "bytes" of what it leaves, "render_seconds", and what else
  /// is worth keeping. kInterrupted.
  Result<Record> (*run)(const Task& task, const Settings& settings, const std::filesystem::path& work);
};

/// All methods; those of other papers join here.
const std::vector<Method>& Methods();
std::vector<std::string> MethodNames();
/// Null for an unknown name.
const Method* FindMethod(const std::string& name);

}  // namespace glint::chart
