#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <memory>
#include <string>
#include <system_error>

#include "coordinator/service/access.h"
#include "tools/commands.h"

namespace glint {
namespace {

struct TokenWords {
  std::string name, output;
  Right right = Right::kSubmit;
};

/// A file that only its owner can read, from the first moment on. kUsage: something is there already.
Status WriteSecret(const std::string& path, const std::string& text) {
  const auto failed = [&](const char* what) {
    return IoError(path + ": cannot " + what + ": " + std::generic_category().message(errno));
  };
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (fd < 0 && errno == EEXIST) return UsageError(path + ": is there already; choose another name");
  if (fd < 0) return failed("make the file");
  const bool written = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const Status status = written && fsync(fd) == 0 ? Status() : failed("write");
  close(fd);
  return status;
}

Status RunToken(const TokenWords& words, const CommonWords& common) {
  GLINT_ASSIGN_OR_RETURN(const std::string token, MakeToken());
  const std::string line = TokenLine(words.name, words.right, token);
  if (const Result<TokenList> sound = TokenList::Parse(line); !sound.ok())
    return UsageError("'" + words.name + "': " + sound.status().message());
  GLINT_RETURN_IF_ERROR(WriteSecret(words.output, token + "\n"));
  if (common.json) {
    PrintJson({{"client", words.name}, {"right", RightName(words.right)}, {"line", line}});
  } else {
    std::printf("%s\n", line.c_str());
  }
  return {};
}

}  // namespace

Command AddTokenCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("token", "Make a token for a client of a service");
  const auto words = std::make_shared<TokenWords>();
  app.add_option("name", words->name, "The client, for the service's log")->required()->type_name("NAME");
  app.add_option("-o,--output", words->output, "File for the token, which only its owner can read")
      ->required()
      ->type_name("FILE");
  AddChoice<Right>(
      app, "--right", words->right,
      {{"read", Right::kRead}, {"submit", Right::kSubmit}, {"admin", Right::kAdmin}},
      "What it allows: to see bakes and fetch archives; also to submit (default); also to delete");
  AddCommonWords(app, common);
  app.footer(
      "Prints the line for the service's file, which has no more than the token's digest.\n"
      "\n"
      "Example:\n"
      "  glint token alice --right submit -o alice.token >> tokens\n"
      "  glint serve --store bakes --token-file tokens\n"
      "  glint submit teapot.glb --token-file alice.token");
  return [words, &common] { return RunToken(*words, common); };
}

}  // namespace glint
