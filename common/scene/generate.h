#pragma once

#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/scene/scene.h"

namespace glint {

/// Options of the generated scenes.
struct GenerateOptions {
  uint32_t vertices = 25000;  ///< aimed at, within a few percent
  float exponent = 0;  ///< > 0: all specular materials become Phong with this exponent (the papers' tables)
};

/// Names that GenerateScene knows, each with one line of description.
struct GeneratedScene {
  std::string name, description;
};
const std::vector<GeneratedScene>& GeneratedScenes();

/// Builds one of Glint's own scenes: "teapot" (teapot-like: body, lid, handle, spout), "goblets" (three
/// goblets on a glossy plane), "knot" (torus knot on a glossy plane), "blob" (bunny-scale closed smooth shape
/// on a diffuse plane), "sphere" (alone: no indirect light), "planes" (two facing planes), "furnace" (closed
/// box, seen from inside, albedo 1). Each has a camera named "main". Errors: kUsage for an unknown name.
Result<Scene> GenerateScene(const std::string& name, const GenerateOptions& options = {});

}  // namespace glint
