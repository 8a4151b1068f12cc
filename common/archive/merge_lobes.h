#pragma once

#include <span>

#include "common/archive/lobe_codec.h"

namespace glint {

/// The one lobe that has the zeroth and first moments of a slice's lobes: what gathering needs of them.
IndirectLobe MergeLobes(std::span<const IndirectLobe> lobes);

}  // namespace glint
