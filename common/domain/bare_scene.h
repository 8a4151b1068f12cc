#pragma once

#include "common/domain/bake_domain.h"
#include "common/scene/scene.h"

namespace glint {

/// A domain's geometry alone, as a RayScene wants it: rays meet the same triangles as in the scene.
Scene BareScene(const BakeDomain& domain);

}  // namespace glint
