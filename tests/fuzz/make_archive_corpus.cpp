// Seeds for fuzz_archive: small archives and tables in both forms, behind the byte that says how they are
// read.
//   make_archive_corpus FOLDER
#include <cstdio>
#include <filesystem>
#include <string>

#include "common/base/files.h"
#include "tests/archive/archive_fixture.h"

namespace {

using namespace glint;

bool Publish(const std::filesystem::path& path, std::byte mode, std::span<const std::byte> bytes) {
  std::vector<std::byte> seed{mode};
  seed.insert(seed.end(), bytes.begin(), bytes.end());
  const Status status = PublishFile(path, seed);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.message().c_str());
  return status.ok();
}

bool WriteSeeds(const std::filesystem::path& folder, TableForm form, const std::string& name) {
  archive_fixture::Content content = archive_fixture::MakeContent(9, 7, 2, 2, form);
  const std::filesystem::path path = folder / (name + ".glint");
  if (const Status status = WriteArchive(path, archive_fixture::Link(&content)); !status.ok()) {
    std::fprintf(stderr, "%s\n", status.message().c_str());
    return false;
  }
  const auto bytes = ReadFile(path, 1 << 24);
  if (!bytes.ok()) return false;
  return Publish(folder / (name + "_plain"), std::byte{0}, *bytes) &&
         Publish(folder / (name + "_resealed"), std::byte{1}, *bytes) &&
         Publish(folder / (name + "_table"), std::byte{2}, content.tables[0][0]) &&
         std::filesystem::remove(path);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_archive_corpus FOLDER\n");
    return 2;
  }
  std::filesystem::create_directories(argv[1]);
  return WriteSeeds(argv[1], TableForm::kCompact, "compact") &&
                 WriteSeeds(argv[1], TableForm::kClassic, "classic")
             ? 0
             : 1;
}
