#include "common/domain/bare_scene.h"

namespace glint {

Scene BareScene(const BakeDomain& domain) {
  Scene scene;
  scene.positions = domain.positions;
  scene.normals = domain.normals;
  scene.triangles = domain.triangles;
  scene.triangle_material.assign(domain.triangles.size(), 0);
  scene.vertex_material.assign(domain.positions.size(), 0);
  scene.materials.resize(1);
  return scene;
}

}  // namespace glint
