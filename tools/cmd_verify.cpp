#include <iostream>
#include <memory>

#include "common/archive/archive.h"
#include "tools/commands.h"

namespace glint {
namespace {

Status RunVerify(const std::string& path, const CommonWords& common) {
  const Status status = VerifyArchive(path, common.threads);
  if (common.json) {
    PrintJson({{"archive", path}, {"ok", status.ok()}, {"problem", status.message()}});
  } else if (status.ok()) {
    std::cout << path << ": every checksum and invariant holds\n";
  }
  return status;
}

}  // namespace

Command AddVerifyCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("verify", "Check every checksum and invariant of an archive");
  const auto path = std::make_shared<std::string>();
  app.add_option("archive", *path, "Archive that 'glint bake' wrote")->required()->type_name("ARCHIVE");
  AddCommonWords(app, common);
  app.footer(
      "Examples:\n"
      "  glint verify teapot.glint && echo sound");
  return [path, &common] { return RunVerify(*path, common); };
}

}  // namespace glint
