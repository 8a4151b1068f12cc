#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/domain/bake_nodes.h"
#include "common/lobes/brdf_table.h"
#include "common/scene/scene.h"

namespace glint {

/// A baked node: all that its slices depend on besides the scene.
struct BakeVertex {
  uint32_t node;
  glm::vec3 normal;  ///< unit shading normal
  uint16_t shape;    ///< index into BakeDomain::shapes
  bool double_sided;
  glm::vec3 specular, diffuse;
};

/// The surface as the bake and the renderer see it: vertices with normals and BRDFs, triangles, fitted
/// shapes. It is what the archive's geometry and BRDF sections hold. Triangle indices are the scene's.
struct BakeDomain {
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;  ///< unit shading normals
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<uint8_t> triangle_double_sided;
  std::vector<glm::vec3> specular;    ///< per vertex: F0 or ks
  std::vector<glm::vec3> diffuse;     ///< per vertex: base (1 - metallic) or kd
  std::vector<uint16_t> shape;        ///< per vertex: index into shapes
  std::vector<uint8_t> double_sided;  ///< per vertex
  std::vector<BrdfShape> shapes;      ///< each distinct (model, shape) of the scene, fitted
  BakeNodes nodes;                    ///< where transfer is known
  std::vector<std::string>
      notes;  ///< what was made simpler than the scene; not part of the archive's surface

  uint32_t vertex_count() const { return static_cast<uint32_t>(positions.size()); }
  /// Bake vertices, each a row of every table.
  uint32_t row_count() const {
    return nodes.every_vertex() ? vertex_count() : static_cast<uint32_t>(nodes.rows.size());
  }
  uint32_t RowNode(uint32_t row) const { return nodes.every_vertex() ? row : nodes.rows[row]; }
  BakeVertex Row(uint32_t row) const { return Node(RowNode(row)); }
  BakeVertex Node(uint32_t node) const;
  /// Middles lie on the surface.
  glm::vec3 NodePosition(uint32_t node) const;
  int max_lobes() const;  ///< largest number of specular lobes of any shape
  bool has_diffuse() const;
  /// Unit geometric normal; 0 for a triangle without area. In double: products of a tiny or a huge scene's
  /// edges leave the range of floats.
  glm::vec3 FaceNormal(uint32_t triangle) const;
  Brdf BrdfOf(const BakeVertex& v) const {
    return {shapes[v.shape].model, shapes[v.shape].shape, v.specular, v.diffuse};
  }
};

/// Textured roughness is rounded to multiples of this, so that a scene needs few shapes.
inline constexpr float kRoughnessStep = 1.0f / 64;
/// A scene with more distinct shapes than this has all of them rounded, materials' own as well (with a note).
inline constexpr size_t kMaxExactShapes = 256;

/// Samples materials at the vertices and fits each distinct shape (in parallel on `threads`).
BakeDomain BuildBakeDomain(const Scene& scene, const BrdfFitOptions& options, int threads);

/// The exact reflectance at a surface point, as lobes/brdf.h wants it.
Brdf ToBrdf(const SurfacePoint& point);

}  // namespace glint
