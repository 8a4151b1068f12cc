#pragma once

#include <vector>

#include "common/domain/bake_domain.h"
#include "common/domain/bake_settings.h"

namespace glint {

/// Seconds of one processor that each vertex is thought to take in layer 0, before any has been measured:
/// from its rays and slices. A guess, right in its proportions rather than in its size.
/// @param columns  view directions
std::vector<float> GuessVertexSeconds(const BakeDomain& domain, const BakeSettings& settings,
                                      uint32_t columns);

}  // namespace glint
