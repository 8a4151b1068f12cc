#pragma once

#include <array>

#include "common/archive/transfer.h"

namespace glint {

/// Zeroth and first moment of the light that one layer sends from a surface point towards wo: alpha (RGB),
/// and the sum of luminance(alpha) ||r|| mu. Merging over hits is adding these (laurijssen2011 Eq. 10, 11
/// without the divisions). {alpha r, g, b, moment x, y, z}; zeros where nothing is reflected.
std::array<float, 6> HitLight(const TransferReader& reader, const LayerViews& layer, int layer_index,
                              uint32_t triangle, float u, float v, const glm::vec3& wo);

}  // namespace glint
