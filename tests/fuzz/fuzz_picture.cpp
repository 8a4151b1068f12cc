// ReadPictureFromMemory on arbitrary bytes: OpenEXR and Radiance HDR. A picture that is accepted must be as
// large as it says, within the limits, and written again must be readable.

#include <cstdlib>
#include <span>

#include "common/render/image.h"
#include "common/render/image_codecs.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  glint::PictureLimits limits;
  limits.side = 512;
  limits.pixels = 1 << 16;
  const std::span<const std::byte> bytes(reinterpret_cast<const std::byte*>(data), size);
  const auto picture = glint::ReadPictureFromMemory(bytes, "fuzz", limits);
  if (!picture.ok()) return picture.status().message().empty() ? (std::abort(), 0) : 0;
  const size_t pixels = static_cast<size_t>(picture->width) * static_cast<size_t>(picture->height);
  if (picture->pixels.size() != pixels || pixels > limits.pixels) std::abort();
  if (!glint::codec::DecodeHdr(glint::codec::EncodeHdr(*picture), "again", limits).ok()) std::abort();
  return 0;
}
