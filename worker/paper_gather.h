#pragma once

#include <memory>

#include "worker/gather.h"

namespace glint {

std::unique_ptr<Gatherer> MakePaperGatherer(const GatherInput& input, const BakeSettings& settings);

}  // namespace glint
