// Writes seeds for fuzz_gltf into the folder given: small scenes that between them use the reader's features.
#include <filesystem>
#include <string>

#include "tests/scene/gltf_samples.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return 1;
  for (const auto& [name, bytes] : glint::test::AllSamples()) {
    if (!glint::test::WriteBytes(folder / name, bytes)) return 1;
  }
  return 0;
}
