#pragma once

#include "tools/options.h"

namespace glint {

// Each declares one sub-command and its words on `glint`, and returns what it does; `common` is filled by
// parsing.

Command AddBakeCommand(CLI::App& glint, CommonWords& common);
Command AddRunTaskCommand(CLI::App& glint, CommonWords& common);
Command AddWorkerCommand(CLI::App& glint, CommonWords& common);
Command AddServeCommand(CLI::App& glint, CommonWords& common);
Command AddTokenCommand(CLI::App& glint, CommonWords& common);
Command AddSubmitCommand(CLI::App& glint, CommonWords& common);
Command AddStatusCommand(CLI::App& glint, CommonWords& common);
Command AddWatchCommand(CLI::App& glint, CommonWords& common);
Command AddCancelCommand(CLI::App& glint, CommonWords& common);
Command AddResumeCommand(CLI::App& glint, CommonWords& common);
Command AddFetchCommand(CLI::App& glint, CommonWords& common);
Command AddDeleteCommand(CLI::App& glint, CommonWords& common);
Command AddRenderCommand(CLI::App& glint, CommonWords& common);
Command AddReferenceCommand(CLI::App& glint, CommonWords& common);
Command AddCompareCommand(CLI::App& glint, CommonWords& common);
Command AddChartCommand(CLI::App& glint, CommonWords& common);
Command AddInspectCommand(CLI::App& glint, CommonWords& common);
Command AddEstimateCommand(CLI::App& glint, CommonWords& common);
Command AddVerifyCommand(CLI::App& glint, CommonWords& common);
Command AddSceneCommand(CLI::App& glint, CommonWords& common);
Command AddEnvironmentCommand(CLI::App& glint, CommonWords& common);

}  // namespace glint
