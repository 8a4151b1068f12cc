#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/scene/gltf_accessor.h"

namespace glint {

/// A mesh decoded by Draco: attributes by their glTF name ("POSITION").
struct DracoMesh {
  uint32_t points = 0;
  std::vector<uint32_t> indices;  ///< three a triangle, each below `points`
  std::map<std::string, FloatArray> attributes;
};

/// Decodes KHR_draco_mesh_compression data. Sizes that the data claims are checked before memory is given to
/// them.
/// @param ids  glTF attribute name -> unique id in the Draco mesh
/// @param normalize glTF attribute name -> whether integers stand for [0, 1] or [-1, 1]
Result<DracoMesh> DecodeDraco(std::span<const std::byte> data, const std::map<std::string, int>& ids,
                              const std::map<std::string, bool>& normalize, uint64_t max_points,
                              uint64_t max_triangles, const std::string& object);

}  // namespace glint
