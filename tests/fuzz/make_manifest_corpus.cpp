// Seeds for fuzz_manifest: manifests of both gatherers.
//   make_manifest_corpus FOLDER
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>

#include "common/base/files.h"
#include "common/round/manifest.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_manifest_corpus FOLDER\n");
    return 2;
  }
  std::filesystem::create_directories(argv[1]);
  for (const glint::GatherMethod method : {glint::GatherMethod::kShared, glint::GatherMethod::kPaper}) {
    glint::RoundManifest round;
    round.execution = "glint 0.1.0; \"quoted\"";
    round.scene = glint::Sha256({});
    round.settings.method = method;
    round.settings.grid_level = 1;
    round.layer = 2;
    round.previous = round.scene;
    round.blocks = {{0, 100, 0, 42}, {100, 7, 0, 20}, {100, 7, 20, 22}};
    const std::string json = glint::ToJson(round);
    const std::string name = method == glint::GatherMethod::kShared ? "shared" : "paper";
    const glint::Status status =
        glint::PublishFile(std::filesystem::path(argv[1]) / name, std::as_bytes(std::span(json)));
    if (!status.ok()) {
      std::fprintf(stderr, "%s\n", status.message().c_str());
      return 1;
    }
  }
  return 0;
}
