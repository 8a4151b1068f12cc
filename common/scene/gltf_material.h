#pragma once

#include <cstdint>
#include <vector>

#include "common/base/status.h"
#include "common/scene/gltf_document.h"

namespace glint {

/// Materials in the file's order, and the textures and images that they use; what is left out becomes notes.
/// @param[out] uv_sets for each material, which TEXCOORD_n its textures use
Status ReadMaterials(const GltfDocument& document, GltfBytes& bytes, const SceneLimits& limits, Scene& scene,
                     std::vector<int>& uv_sets);

}  // namespace glint
