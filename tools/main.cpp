#include <exception>
#include <iostream>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "tools/commands.h"

namespace glint {
namespace {

constexpr char kAbout[] =
    "Glint bakes multi-bounce glossy light transport of a static glTF scene into an archive that can be "
    "looked at "
    "from anywhere under any distant environment.";

constexpr char kFooter[] =
    "Examples:\n"
    "  glint scene teapot -o teapot.glb\n"
    "  glint bake teapot.glb -o teapot.glint\n"
    "  glint render teapot.glint --env procedural:sunset --size 1024x768 -o teapot.png\n"
    "  glint COMMAND --help\n"
    "\n"
    "Exit codes:\n"
    "  0  done\n"
    "  1  internal error (a bug of Glint's)\n"
    "  2  usage: wrong words\n"
    "  3  bad input: a file or value that cannot be used\n"
    "  4  limit: input larger than a limit allows\n"
    "  5  interrupted: the same command goes on where it was\n"
    "  6  the file system or the environment failed\n"
    "  7  verification or comparison found a difference\n"
    "NO_COLOR is honoured; nothing is animated unless standard error is a terminal.";

using Adder = Command (*)(CLI::App&, CommonWords&);
constexpr std::pair<const char*, Adder> kCommands[] = {
    {"bake", AddBakeCommand},     {"run-task", AddRunTaskCommand},    {"worker", AddWorkerCommand},
    {"serve", AddServeCommand},   {"token", AddTokenCommand},         {"submit", AddSubmitCommand},
    {"status", AddStatusCommand}, {"watch", AddWatchCommand},         {"cancel", AddCancelCommand},
    {"resume", AddResumeCommand}, {"fetch", AddFetchCommand},         {"delete", AddDeleteCommand},
    {"render", AddRenderCommand}, {"reference", AddReferenceCommand}, {"compare", AddCompareCommand},
    {"chart", AddChartCommand},   {"inspect", AddInspectCommand},     {"estimate", AddEstimateCommand},
    {"verify", AddVerifyCommand}, {"scene", AddSceneCommand},         {"environment", AddEnvironmentCommand}};

int Fail(const Status& status) {
  Log(LogLevel::kError, status.message());
  return static_cast<int>(status.kind());
}

/// What is wrong with the words. Where no command is recognised, CLI11 only says that one is missing.
std::string Explain(const CLI::ParseError& error, const CLI::App& app, int argc, char** argv) {
  const auto chosen = app.get_subcommands();
  if (!chosen.empty())
    return std::string(error.what()) + "; see 'glint " + chosen[0]->get_name() + " --help'";
  if (argc < 2) return "no command given; see 'glint --help'";
  return "'" + std::string(argv[1]) + "' is no command; see 'glint --help'";
}

Status RunChosen(const CLI::App& app, const CommonWords& common, const std::vector<Command>& commands) {
  if (common.quiet) SetLogLevel(LogLevel::kError);
  InstallStopHandler();
  for (size_t i = 0; i < std::size(kCommands); ++i) {
    if (!app.got_subcommand(kCommands[i].first)) continue;
    GLINT_RETURN_IF_ERROR(commands[i]());
    std::cout.flush();
    return std::cout ? Status() : IoError("cannot write to standard output");
  }
  return UsageError("no command given; see 'glint --help'");
}

int Main(int argc, char** argv) {
  CLI::App app(kAbout, "glint");
  app.set_version_flag("--version", "glint " GLINT_VERSION, "Print the version and exit");
  app.require_subcommand(1);
  app.footer(kFooter);
  app.get_formatter()->column_width(34);
  CommonWords common;
  std::vector<Command> commands;
  for (const auto& [name, add] : kCommands) commands.push_back(add(app, common));

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(error);
    return Fail(UsageError(Explain(error, app, argc, argv)));
  }
  const Status status = RunChosen(app, common, commands);
  return status.ok() ? 0 : Fail(status);
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) {
  try {
    return glint::Main(argc, argv);
  } catch (const std::bad_alloc&) {
    return glint::Fail(
        glint::LimitExceeded("out of memory; try a smaller scene or picture, or fewer threads"));
  } catch (const std::exception& error) {
    return glint::Fail(glint::InternalError(std::string("internal error: ") + error.what()));
  }
}
