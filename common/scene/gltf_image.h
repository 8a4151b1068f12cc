#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "common/base/status.h"
#include "common/scene/load.h"

namespace glint {

/// Decodes PNG or JPEG to 8-bit RGBA. Dimensions are checked before anything is decoded.
/// @param pixels_left pixels that the file's images may still have together; reduced by this one's
Result<Image> DecodeImage(std::span<const std::byte> bytes, const std::string& name,
                          const SceneLimits& limits, uint64_t& pixels_left, const std::string& object);

}  // namespace glint
