#pragma once

#include <span>

#include "common/archive/lobe_codec.h"
#include "common/lobes/vmf.h"

namespace glint {

/// The one lobe that has the zeroth and first moments of a slice's lobes: what gathering needs of them.
IndirectLobe MergeLobes(std::span<const IndirectLobe> lobes);

/// The same of a direct slice's.
/// @param whole  the unoccluded lobe that they are relative to
DirectLobe MergeLobes(std::span<const DirectLobe> lobes, const Vmf& whole);

}  // namespace glint
