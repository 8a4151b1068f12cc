#pragma once

namespace glint {

/// A named place where a test may end the process as `kill -9` would. The environment variable
/// GLINT_CRASH_AT="<point>:<n>" makes the n-th passing (1, 2, ...) of `point` in this process its last;
/// without it, or with a value of another form, passing costs one atomic load. Publishing a file (files.h)
/// passes, in this order: before-write, after-write, before-rename, after-rename, after-dir-fsync.
void CrashPoint(const char* point);

}  // namespace glint
