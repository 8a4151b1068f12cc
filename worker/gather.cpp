#include "worker/gather.h"

#include "worker/gather_kernel.h"
#include "worker/paper_gather.h"
#include "worker/shared_gather.h"

namespace glint {

std::unique_ptr<Gatherer> MakeGatherer(const GatherInput& input, const BakeSettings& settings,
                                       uint64_t memory_bytes) {
  if (settings.method == GatherMethod::kPaper) return MakePaperGatherer(input, settings);
  return MakeSharedGatherer(input, settings, memory_bytes);
}

const char* GatherKernelLevel() { return SelectGatherKernels().level; }

}  // namespace glint
