#pragma once

#include "common/scene/scene.h"

namespace glint {

/// Makes all materials Phong with that exponent; with 0, leaves them as they are.
inline void MakePhong(float exponent, Scene* scene) {
  if (exponent <= 0) return;
  for (Material& material : scene->materials) {
    material.model = MaterialModel::kPhong;
    material.exponent = exponent;
    material.specular = 0.9f * material.base_color;
  }
  scene->content = HashScene(*scene);
}

}  // namespace glint
