#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>

#include "coordinator/bake.h"

namespace glint {

/// What a service has done since it was started, over all bakes.
struct ServiceCounts {
  uint64_t tasks_computed = 0;
  uint64_t tasks_found = 0;                     ///< their results were there
  uint64_t rays = 0;                            ///< of layers that are merged
  uint64_t collected_bytes = 0;                 ///< Garbage
  std::map<std::string, double> stage_seconds;  ///< "load", "fit", "layer", "merge", "estimate", "write"
};

/// Adds up what a bake's progress tells.
class BakeMeter {
 public:
  /// What has come about since the last call goes into `counts`.
  void Note(const BakeProgress& progress, ServiceCounts* counts);
  /// The bake has ended: so has its last stage.
  void End(ServiceCounts* counts);

 private:
  using Clock = std::chrono::steady_clock;
  void CountSeconds(ServiceCounts* counts);

  BakeProgress last_;
  Clock::time_point since_ = Clock::now();
};

}  // namespace glint
