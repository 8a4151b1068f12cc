#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/domain/bake_domain.h"

namespace glint {

/// A coarser vertex and its part in a prediction.
struct Parent {
  uint32_t node;
  float weight;
};

/// A mesh's vertices ordered from coarse to fine: level after level of the mesh with ever more vertices taken
/// away, so that each is predicted by what remains around it.
struct VertexHierarchy {
  int levels = 0;                            ///< besides level 0, the coarsest
  std::vector<uint32_t> welded;              ///< WeldVertices(); what follows is meant for the first of each
  std::vector<uint8_t> level;                ///< of each vertex: 0 .. levels
  std::vector<std::vector<Parent>> parents;  ///< of lower levels, weights add up to 1; none in level 0
  std::vector<float> area;  ///< of the surface that the vertex stood for when it was taken away
  uint32_t degenerate = 0;  ///< triangles that welding made degenerate
  uint32_t non_manifold =
      0;  ///< triangles that do not fit the others' surface; their vertices are in level 0
};

/// Coarsens the surface by half-edge collapses, an independent set of vertices for each level. A vertex goes
/// only where the faces that are left hardly turn (by 60 degrees), its neighbours' shading normals are within
/// 60 degrees of its own, and borders stay straight to 30 degrees; sharp edges, seams of materials and of
/// what else WeldVertices tells apart are borders. A function of the domain alone.
VertexHierarchy BuildHierarchy(const BakeDomain& domain);

}  // namespace glint
