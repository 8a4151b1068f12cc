#pragma once

#include <glm/vec3.hpp>
#include <vector>

namespace glint {

/// A 0.7 m wide display of 3840 pixels seen from 0.7 m.
inline constexpr float kFlipPixelsPerDegree = 67;

/// Per-pixel LDR-FLIP error in [0, 1]. Pictures in linear RGB, [0, 1], width x height, at least one pixel.
std::vector<float> Flip(const std::vector<glm::vec3>& test, const std::vector<glm::vec3>& reference,
                        int width, int height, float pixels_per_degree);

}  // namespace glint
