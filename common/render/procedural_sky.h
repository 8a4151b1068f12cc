#pragma once

#include <glm/vec3.hpp>
#include <string>

namespace glint {

/// Linear radiance that a procedural sky sends from the unit direction d (y up).
using SkyFunction = glm::vec3 (*)(const glm::vec3& d);

/// "studio", "sunset" or "uniform"; null for another name. None is symmetric in azimuth except "uniform".
SkyFunction FindProceduralSky(const std::string& name);

}  // namespace glint
