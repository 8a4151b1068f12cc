#pragma once

#include <cstddef>
#include <functional>

namespace glint {

/// Threads to use for `requested` (0: one per core that this process may run on). At least 1.
int ResolveThreadCount(int requested);

/// Runs body(i, thread) for every i in [0, count) on `threads` threads, dynamically in blocks of `grain`;
/// `thread` is in [0, threads). Returns when all are done. The body must not depend on the order. If it
/// throws (memory may run out anywhere), no further block is started, and once every thread is done the first
/// exception is thrown again, on the caller's thread.
void ParallelFor(size_t count, int threads, size_t grain,
                 const std::function<void(size_t i, int thread)>& body);

}  // namespace glint
