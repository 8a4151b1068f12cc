#pragma once

#include <nlohmann/json.hpp>

#include "common/base/status.h"

namespace glint {

/// Checks a glTF document's JSON against the parts of the format that Glint reads, and returns a copy with
/// those parts only: every kept member has the right type, integers fit where they are going, arrays have
/// their lengths. Errors name the member ("meshes[2].primitives[0].attributes.NORMAL").
///
/// Two changes make the copy safe to parse further: `buffers` and `images` keep only what says where their
/// bytes are, and a primitive's `indices` become its attribute kIndicesAttribute, since an index accessor
/// without a buffer view (usual with Draco) would be refused otherwise.
Result<nlohmann::json> CheckGltfJson(const nlohmann::json& document);

inline constexpr const char* kIndicesAttribute = "_GLINT_INDICES";
inline constexpr const char* kDracoExtension = "KHR_draco_mesh_compression";

}  // namespace glint
