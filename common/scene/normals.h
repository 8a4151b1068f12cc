#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace glint {

/// Unit normals of vertices, the mean of their triangles' face normals weighted by the angle each triangle
/// has at the vertex (Thuermer and Wuethrich 1998). Vertices without a triangle of positive area get +Y.
std::vector<glm::vec3> AngleWeightedNormals(std::span<const glm::vec3> positions,
                                            std::span<const std::array<uint32_t, 3>> triangles);

}  // namespace glint
