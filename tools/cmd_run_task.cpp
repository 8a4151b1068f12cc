#include <filesystem>
#include <memory>

#include "common/base/log.h"
#include "common/base/parallel.h"
#include "common/round/round_files.h"
#include "tools/commands.h"
#include "worker/bake_runner.h"

namespace glint {
namespace {

struct RunTaskWords {
  std::string manifest, store;
  size_t index = 0;
};

Status RunRunTask(const RunTaskWords& words, const CommonWords& common) {
  GLINT_ASSIGN_OR_RETURN(const RoundManifest round, ReadManifest(words.manifest));
  // One task: nothing is kept for a next one.
  GLINT_ASSIGN_OR_RETURN(BakeRunner runner,
                         BakeRunner::Open(words.store, ResolveThreadCount(common.threads), 0));
  GLINT_ASSIGN_OR_RETURN(const bool was_there, runner.Run(round, words.index));
  const std::string key = round.Task(words.index).key.Hex();
  Log(LogLevel::kNote, "task " + std::to_string(words.index) + " of layer " + std::to_string(round.layer) +
                           (was_there ? " had its result" : " is done"));
  if (common.json) {
    PrintJson({{"task", words.index}, {"layer", round.layer}, {"key", key}, {"was_there", was_there}});
  }
  return {};
}

}  // namespace

Command AddRunTaskCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("run-task", "Compute one task of a bake and store its result");
  const auto words = std::make_shared<RunTaskWords>();
  app.add_option("--manifest", words->manifest, "The round: a file of the bake's folder 'rounds'")
      ->required()
      ->type_name("FILE");
  app.add_option("--index", words->index, "Which task of the round, from 0")->required()->type_name("I");
  app.add_option("--store", words->store, "The bake's folder")
      ->required()
      ->check(CLI::ExistingDirectory)
      ->type_name("FOLDER");
  AddCommonWords(app, common);
  app.footer(
      "May be repeated, and run any number of times at once: a task whose result is there is not computed "
      "again.\n"
      "'glint bake --executor manual' and the message that it ends with say what to run.\n"
      "\n"
      "Example:\n"
      "  glint run-task --manifest W/rounds/0a1b....json --store W --index 3");
  return [words, &common] { return RunRunTask(*words, common); };
}

}  // namespace glint
