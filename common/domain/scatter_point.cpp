#include "common/domain/scatter_point.h"

#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>

#include "common/base/bend_normal.h"

namespace glint {
namespace {

glm::vec3 Interpolate(const std::vector<glm::vec3>& values, const std::array<uint32_t, 3>& corner,
                      const Hit& hit) {
  return (1.0f - hit.u - hit.v) * values[corner[0]] + hit.u * values[corner[1]] + hit.v * values[corner[2]];
}

}  // namespace

bool MakeScatterPoint(const std::vector<glm::vec3>& positions, const std::vector<glm::vec3>& normals,
                      const std::array<uint32_t, 3>& corner, bool double_sided, const Hit& hit,
                      const glm::vec3& wo, ScatterPoint* point) {
  const glm::vec3& p0 = positions[corner[0]];
  const glm::vec3 e1 = positions[corner[1]] - p0, e2 = positions[corner[2]] - p0;
  // In double: products of a tiny or a huge scene's edges leave the range of floats.
  const glm::dvec3 cross = glm::cross(glm::dvec3(e1), glm::dvec3(e2));
  const double area = glm::length(cross);
  if (!(area > 0)) return false;
  point->face = glm::vec3(cross / area);
  point->position = p0 + hit.u * e1 + hit.v * e2;
  const bool behind = glm::dot(point->face, wo) < 0;
  if (behind && !double_sided) return false;

  glm::vec3 normal = Interpolate(normals, corner, hit);
  const float length = glm::length(normal);
  normal = length > 1e-6f ? normal / length : point->face;
  if (behind) {
    point->face = -point->face;
    normal = -normal;
  }
  if (!(glm::dot(point->face, wo) > 0)) return false;  // exactly edge-on
  point->frame = Frame::FromNormal(BendNormal(point->face, wo, normal));
  point->wo_local = point->frame.ToLocal(wo);
  return point->wo_local.z > 0;
}

DomainBrdf BrdfAt(const BakeDomain& domain, const Hit& hit) {
  const std::array<uint32_t, 3>& corner = domain.triangles[hit.triangle];
  const float w = 1.0f - hit.u - hit.v;
  const uint32_t nearest = corner[w >= hit.u && w >= hit.v ? 0 : (hit.u >= hit.v ? 1 : 2)];
  const BrdfShape& shape = domain.shapes[domain.shape[nearest]];
  return {{shape.model, shape.shape, Interpolate(domain.specular, corner, hit),
           Interpolate(domain.diffuse, corner, hit)},
          &shape};
}

}  // namespace glint
