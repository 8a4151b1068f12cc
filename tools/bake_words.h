#pragma once

#include "coordinator/bake.h"
#include "tools/options.h"

namespace glint {

/// What decides a bake's result, as words: the same wherever a bake is asked for.
void AddAccuracyWords(CLI::App& app, BakeOptions& options);
/// Sizes of tasks and the form of tables.
void AddTaskWords(CLI::App& app, BakeOptions& options);

}  // namespace glint
