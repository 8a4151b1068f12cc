// Seeds for fuzz_request, behind the byte that says what they are: a request, and a file of tokens.
//   make_request_corpus FOLDER
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <utility>

#include "common/base/files.h"
#include "coordinator/service/access.h"
#include "coordinator/service/journal.h"

namespace {

std::string Request() {
  glint::BakeRequest request;
  request.key = "monday";
  request.scene = glint::Sha256({});
  request.name = "scene.glb";
  request.estimate_slices = 64;
  return '\0' + glint::ToJson(request);
}

std::string Tokens() {
  return "\1# clients\n" + glint::TokenLine("alice", glint::Right::kSubmit, "a") + "\n" +
         glint::TokenLine("bob@example.org", glint::Right::kAdmin, "b") + " # since May\n";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_request_corpus FOLDER\n");
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  for (const auto& [name, seed] : {std::pair("request", Request()), std::pair("tokens", Tokens())}) {
    const glint::Status status = glint::PublishFile(folder / name, std::as_bytes(std::span(seed)));
    if (!status.ok()) {
      std::fprintf(stderr, "%s\n", status.message().c_str());
      return 1;
    }
  }
  return 0;
}
