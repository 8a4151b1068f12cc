#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/render/image.h"

/// The file formats behind image.h, one source file each. Decoders check sizes against the limits before they
/// allocate; `name` stands in messages. None of them throws.
namespace glint::codec {

/// kLimit if the picture would be larger than `limits`, kBadInput if it is empty.
Status CheckSize(int64_t width, int64_t height, const PictureLimits& limits, const std::string& name);

Result<Picture> DecodeExr(std::span<const std::byte> bytes, const std::string& name,
                          const PictureLimits& limits);
Result<std::vector<std::byte>> EncodeExr(const Picture& picture, const std::string& name, bool full_float);

Result<Picture> DecodeHdr(std::span<const std::byte> bytes, const std::string& name,
                          const PictureLimits& limits);
std::vector<std::byte> EncodeHdr(const Picture& picture);

Result<Picture> DecodePng(std::span<const std::byte> bytes, const std::string& name,
                          const PictureLimits& limits);
Result<std::vector<std::byte>> EncodePng(const Picture& picture, const std::string& name,
                                         const ToneMap& tone);

}  // namespace glint::codec
