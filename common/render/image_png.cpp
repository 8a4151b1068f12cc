// PNG through libpng's simplified interface, which keeps its error jumps to itself.

#include <png.h>

#include <cmath>
#include <cstring>

#include "common/render/image_codecs.h"

namespace glint::codec {
namespace {

/// Frees what libpng attached to the image, on every way out.
struct PngImage {
  png_image image{};
  PngImage() { image.version = PNG_IMAGE_VERSION; }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
  ~PngImage() { png_image_free(&image); }
};

uint8_t ToByte(float unit) { return static_cast<uint8_t>(std::lround(unit * 255)); }

}  // namespace

Result<Picture> DecodePng(std::span<const std::byte> bytes, const std::string& name,
                          const PictureLimits& limits) {
  PngImage png;
  const auto failed = [&] {
    return BadInput(name + ": cannot be read as PNG (" + png.image.message + "); write the file again");
  };
  if (png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size()) == 0) return failed();
  GLINT_RETURN_IF_ERROR(CheckSize(png.image.width, png.image.height, limits, name));
  if ((png.image.format & PNG_FORMAT_FLAG_LINEAR) != 0)
    return BadInput(name + ": has 16 bits a channel; save it with 8");
  png.image.format = PNG_FORMAT_RGBA;
  Picture picture(static_cast<int>(png.image.width), static_cast<int>(png.image.height));
  std::vector<uint8_t> values(picture.pixels.size() * 4);
  if (png_image_finish_read(&png.image, nullptr, values.data(), 0, nullptr) == 0) return failed();
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    for (int c = 0; c < 4; ++c) picture.pixels[i][c] = static_cast<float>(values[4 * i + c]) / 255.0f;
  return picture;
}

Result<std::vector<std::byte>> EncodePng(const Picture& picture, const std::string& name,
                                         const ToneMap& tone) {
  std::vector<uint8_t> values(picture.pixels.size() * 4);
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    const glm::vec4& pixel = picture.pixels[i];
    const glm::vec3 display = ToneMapped(glm::vec3(pixel), tone);
    for (int c = 0; c < 3; ++c) values[4 * i + c] = ToByte(LinearToSrgb(display[c]));
    values[4 * i + 3] = ToByte(pixel.w > 0 ? std::min(pixel.w, 1.0f) : 0.0f);
  }
  PngImage png;
  png.image.width = static_cast<png_uint_32>(picture.width);
  png.image.height = static_cast<png_uint_32>(picture.height);
  png.image.format = PNG_FORMAT_RGBA;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png.image);
  std::vector<std::byte> out(size);
  if (png_image_write_to_memory(&png.image, out.data(), &size, 0, values.data(), 0, nullptr) == 0)
    return InternalError(name + ": libpng could not encode the picture (" + png.image.message + ")");
  out.resize(size);
  return out;
}

}  // namespace glint::codec
