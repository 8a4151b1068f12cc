#include "common/scene/gltf_image.h"

#include <cstdlib>
#include <limits>
#include <memory>

namespace glint {
namespace {

// A PNG's compressed data can grow a thousandfold, whatever the picture's size: no single block that the
// decoder asks for may be larger than the picture can need.
thread_local size_t largest_block = 0;

void* BoundedAllocate(size_t size) { return size <= largest_block ? std::malloc(size) : nullptr; }
void* BoundedReallocate(void* block, size_t size) {
  return size <= largest_block ? std::realloc(block, size) : nullptr;
}

}  // namespace
}  // namespace glint

#define STBI_MALLOC(size) glint::BoundedAllocate(size)
#define STBI_REALLOC(block, size) glint::BoundedReallocate(block, size)
#define STBI_FREE(block) std::free(block)
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_NO_LINEAR
#define STBI_NO_HDR
#define STBI_NO_FAILURE_STRINGS
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wsign-compare"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

namespace glint {

Result<Image> DecodeImage(std::span<const std::byte> bytes, const std::string& name,
                          const SceneLimits& limits, uint64_t& pixels_left, const std::string& object) {
  if (bytes.size() > static_cast<size_t>(std::numeric_limits<int>::max())) {
    return LimitExceeded(object + ": has more than 2 GiB; use a smaller image");
  }
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  const int size = static_cast<int>(bytes.size());
  largest_block = size_t{1} << 20;  // for the decoder's own state while it looks at the header
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(data, size, &width, &height, &channels) || width <= 0 || height <= 0) {
    return BadInput(object + ": is not a PNG or JPEG image that can be read; convert it");
  }
  const uint64_t pixels = uint64_t(width) * uint64_t(height);
  const auto side = static_cast<int64_t>(limits.image_side);
  if (width > side || height > side || pixels > pixels_left) {
    return LimitExceeded(object + ": " + std::to_string(width) + " x " + std::to_string(height) +
                         " pixels, beyond the limit of " + std::to_string(limits.image_side) + " a side or " +
                         std::to_string(limits.image_pixels) + " in all images; make it smaller");
  }
  // 16-bit RGBA with a filter byte a row (and a rounded-up buffer twice that while it grows), and the file
  // itself.
  largest_block = static_cast<size_t>(pixels * 16 + uint64_t(height) * 2 + bytes.size() + (1 << 20));
  const std::unique_ptr<stbi_uc, decltype(&std::free)> decoded(
      stbi_load_from_memory(data, size, &width, &height, &channels, 4), &std::free);
  if (!decoded || uint64_t(width) * uint64_t(height) != pixels) {
    return BadInput(object + ": the image is damaged; export or convert it again");
  }
  pixels_left -= pixels;
  Image image;
  image.name = name;
  image.width = width;
  image.height = height;
  image.rgba.assign(decoded.get(), decoded.get() + pixels * 4);
  return image;
}

}  // namespace glint
