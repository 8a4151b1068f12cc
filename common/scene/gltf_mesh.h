#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/scene/gltf_document.h"

namespace glint {

/// What reading meshes left out or mended, for the scene's notes.
struct MeshCounts {
  uint64_t degenerate_triangles = 0;
  uint64_t made_normals = 0;      ///< vertices of meshes without normals
  uint64_t repaired_normals = 0;  ///< vertices whose normal was zero or not of unit length
  uint64_t turned_normals = 0;    ///< vertices whose normal pointed to the back of their faces
  uint64_t unused_vertices = 0;
  uint64_t skipped_primitives = 0;  ///< points and lines
};

/// What the primitives still to come may take of the scene's limits, as they stand in the file (before
/// instancing). Charged before memory is given, so that many primitives that name one array pay each time.
struct MeshBudget {
  uint64_t vertices, triangles;
};

/// One primitive in its mesh's space: triangles that have an area, over vertices that they all use. All
/// arrays have one element a vertex.
struct MeshPart {
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec2> uvs;
  std::vector<glm::vec4> colors;
  std::vector<std::array<uint32_t, 3>> triangles;
  int material = -1;
};

/// Reads meshes[mesh].primitives[primitive] (the vertices that it uses alone); no triangles for points and
/// lines. kLimit when the budget does not allow it.
/// @param uv_set which TEXCOORD_n the material's textures use
Result<MeshPart> ReadPrimitive(const GltfDocument& document, GltfBytes& bytes, size_t mesh, size_t primitive,
                               int uv_set, const SceneLimits& limits, MeshBudget& budget, MeshCounts& counts);

}  // namespace glint
