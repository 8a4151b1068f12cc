#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "common/base/frame.h"
#include "common/domain/bake_domain.h"
#include "common/lobes/brdf.h"
#include "common/lobes/brdf_table.h"
#include "common/scene/ray_scene.h"

namespace glint {

/// A surface point that a path is scattered at: position and frames on wo's side. World, but for wo_local.
struct ScatterPoint {
  glm::vec3 position{0};
  glm::vec3 face{0, 0, 1};  ///< unit face normal
  Frame frame;              ///< around the shading normal, bent (BendNormal) so that wo's mirror image leaves
  glm::vec3 wo_local{0};    ///< in the frame; z > 0

  /// A ray along `wi`, moved off the face.
  Ray Leaving(const glm::vec3& wi, float epsilon) const {
    Ray ray;
    ray.origin = position + face * epsilon;
    ray.direction = wi;
    return ray;
  }
};

/// The point where a ray met a triangle, seen from `wo` (unit, back along the ray). False where nothing is
/// reflected: behind a single-sided surface, exactly edge-on, or where the face has no area.
/// @param positions, normals  of the mesh's vertices; `corner` are the triangle's
bool MakeScatterPoint(const std::vector<glm::vec3>& positions, const std::vector<glm::vec3>& normals,
                      const std::array<uint32_t, 3>& corner, bool double_sided, const Hit& hit,
                      const glm::vec3& wo, ScatterPoint* point);

/// Reflectance where a ray met the domain, as the archive reads it: reflectances blend over the triangle. The
/// shape is the nearest vertex's (where the three differ the archive blends their lobes, so that textured
/// roughness has no steps).
struct DomainBrdf {
  Brdf brdf;
  const BrdfShape* shape;
};
DomainBrdf BrdfAt(const BakeDomain& domain, const Hit& hit);

}  // namespace glint
