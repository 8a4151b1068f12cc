#pragma once

#include <vector>

#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/round/manifest.h"
#include "coordinator/executor.h"

namespace glint {

/// What other processes read to compute a round's tasks, written into the bake's folder: manifest and input
/// (common/round/round_files.h). Returns the manifest's name. Safe to repeat; mends what is damaged. kIo,
/// kLimit.
Result<Digest> PublishRound(const ExecutorInput& bake, const Round& round);

/// Indices of the tasks that have no result.
std::vector<size_t> FindMissing(const ChunkStore& store, const Round& round);

}  // namespace glint
