#pragma once

#include <memory>

#include "worker/gather.h"

namespace glint {

std::unique_ptr<Gatherer> MakeSharedGatherer(const GatherInput& input, const BakeSettings& settings,
                                             uint64_t memory_bytes);

}  // namespace glint
