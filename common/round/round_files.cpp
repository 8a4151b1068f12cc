#include "common/round/round_files.h"

#include <string>
#include <utility>
#include <vector>

#include "common/base/files.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxManifestBytes = uint64_t{256} << 20;  ///< kMaxRoundTasks at their longest

}  // namespace

fs::path ManifestPath(const fs::path& bake, const Digest& manifest) {
  return bake / "rounds" / (manifest.Hex() + ".json");
}
fs::path PlanPath(const fs::path& bake, const Digest& input_key) {
  return bake / "plans" / (input_key.Hex() + ".json");
}
fs::path InputPath(const fs::path& bake, const Digest& input_key) {
  return bake / "inputs" / (input_key.Hex() + ".glint");
}
fs::path InputRowsPath(const fs::path& bake, const Digest& input_key) {
  return bake / "inputs" / (input_key.Hex() + ".rows");
}
fs::path QuarantinePath(const fs::path& bake, const Digest& task_key) {
  return bake / "failed" / (task_key.Hex() + ".json");
}

Result<Digest> WriteManifest(const fs::path& bake, const RoundManifest& manifest) {
  const std::string json = ToJson(manifest);
  const Digest name = Sha256(std::as_bytes(std::span(json)));
  const fs::path path = ManifestPath(bake, name);
  GLINT_RETURN_IF_ERROR(CreateFolders(path.parent_path()));
  GLINT_RETURN_IF_ERROR(PublishFile(path, std::as_bytes(std::span(json))));
  return name;
}

Result<RoundManifest> ReadManifest(const fs::path& path) {
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, kMaxManifestBytes));
  Result<RoundManifest> manifest = ParseRoundManifest(bytes);
  return manifest.ok() ? std::move(manifest) : manifest.status().WithContext(path.string());
}

Result<RoundManifest> ReadManifest(const fs::path& bake, const Digest& manifest) {
  const fs::path path = ManifestPath(bake, manifest);
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, kMaxManifestBytes));
  if (Sha256(bytes) != manifest)
    return BadInput(path.string() + ": the content is not the one that the name promises; remove the file");
  Result<RoundManifest> parsed = ParseRoundManifest(bytes);
  return parsed.ok() ? std::move(parsed) : parsed.status().WithContext(path.string());
}

}  // namespace glint
