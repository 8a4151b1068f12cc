#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "common/base/status.h"
#include "common/scene/scene.h"

namespace glint {

/// Bounds on what a scene file may ask for.
struct SceneLimits {
  uint64_t file_bytes = uint64_t{4} << 30;    ///< of the .gltf/.glb and each buffer or image beside it
  uint64_t vertices = 64'000'000;             ///< after instancing
  uint64_t triangles = 128'000'000;           ///< after instancing
  uint32_t image_side = 16384;                ///< pixels
  uint64_t image_pixels = uint64_t{1} << 28;  ///< of all images together
  uint32_t node_depth = 256;
};

/// Loads glTF 2.0 (.gltf with files beside it, or .glb).
/// Errors: kBadInput or kLimit naming the file, the object ("meshes[2].primitives[0].attributes.NORMAL") and
/// the remedy.
Result<Scene> LoadScene(const std::filesystem::path& path, const SceneLimits& limits = {});

/// The same from memory (GLB or glTF with embedded data only); `name` is used in messages.
Result<Scene> LoadSceneFromMemory(std::span<const std::byte> bytes, const std::string& name,
                                  const SceneLimits& limits = {});

/// Writes a scene (untextured materials, one mesh a material, cameras) as GLB, by which own scenes become
/// files.
Status SaveScene(const Scene& scene, const std::filesystem::path& path);

}  // namespace glint
