#pragma once

#include <memory>

#include "worker/gather.h"

namespace glint {

/// How the rays of one slice are traced; packets are faster, most where lobes are sharp.
enum class PaperTracing { kPackets, kOneByOne };

std::unique_ptr<Gatherer> MakePaperGatherer(const GatherInput& input, const BakeSettings& settings,
                                            PaperTracing tracing = PaperTracing::kPackets);

}  // namespace glint
