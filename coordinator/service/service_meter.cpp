#include "coordinator/service/service_meter.h"

namespace glint {

// A round that is run again, to mend damaged chunks, begins again at no task under the name that it had.
void BakeMeter::Note(const BakeProgress& progress, ServiceCounts* counts) {
  CountSeconds(counts);
  const bool goes_on = progress.stage == last_.stage && progress.done >= last_.done;
  const BakeProgress from = goes_on ? last_ : BakeProgress();
  const uint64_t found = progress.found - from.found;
  counts->tasks_found += found;
  counts->tasks_computed += progress.done - from.done - found;
  counts->rays += progress.rays - last_.rays;
  last_ = progress;
}

void BakeMeter::End(ServiceCounts* counts) {
  CountSeconds(counts);
  last_ = {};
}

void BakeMeter::CountSeconds(ServiceCounts* counts) {
  const Clock::time_point now = Clock::now();
  const std::string kind = last_.stage.substr(0, last_.stage.find(' '));  // "layer" of "layer 2"
  if (!kind.empty()) counts->stage_seconds[kind] += std::chrono::duration<double>(now - since_).count();
  since_ = now;
}

}  // namespace glint
