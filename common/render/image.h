#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/base/status.h"

namespace glint {

/// A linear RGBA picture, alpha = coverage (not premultiplied: background pixels are black anyway), top row
/// first.
struct Picture {
  int width = 0, height = 0;
  std::vector<glm::vec4> pixels;  ///< height x width

  Picture() = default;
  Picture(int w, int h) : width(w), height(h), pixels(size_t(w) * h, glm::vec4(0)) {}
  glm::vec4& at(int x, int y) { return pixels[size_t(y) * width + x]; }
  const glm::vec4& at(int x, int y) const { return pixels[size_t(y) * width + x]; }
};

struct PictureLimits {
  int side = 32768;
  uint64_t pixels = uint64_t{1} << 28;
  uint64_t file_bytes = uint64_t{2} << 30;
};

/// How linear radiance becomes 8-bit sRGB.
struct ToneMap {
  float exposure = 1;    ///< multiplies radiance first
  bool reinhard = true;  ///< global Reinhard x / (1 + x) on luminance; else clamp
};

/// kUsage unless the exposure is a positive, finite number.
Status CheckTone(const ToneMap& tone);

/// Linear display value in [0, 1] of a radiance, before the sRGB curve. NaN and negative values become 0.
glm::vec3 ToneMapped(const glm::vec3& radiance, const ToneMap& tone);
/// The sRGB transfer curve (IEC 61966-2-1) and its inverse, on [0, 1].
float LinearToSrgb(float linear);
float SrgbToLinear(float encoded);

/// Reads OpenEXR (R, G, B and perhaps A, or Y and perhaps A; any pixel type; scan lines or tiles; the first
/// part) or Radiance HDR (alpha 1; all eight orientations). An EXR picture covers the display window: 0
/// outside the data window, alpha 1 inside if the file has none. kBadInput, kLimit or kIo naming the file and
/// the remedy.
Result<Picture> ReadPicture(const std::filesystem::path& path, const PictureLimits& limits = {});
Result<Picture> ReadPictureFromMemory(std::span<const std::byte> bytes, const std::string& name,
                                      const PictureLimits& limits = {});
/// By extension: .exr (half RGBA unless `full_float`; larger values become 65504), .hdr (RGBE, alpha
/// dropped), .png (tone-mapped 8-bit sRGB, alpha kept). The bytes depend on the picture alone. Published
/// atomically. kUsage for another extension and for a tone that CheckTone refuses, kBadInput for an
/// empty picture, kIo.
Status WritePicture(const Picture& picture, const std::filesystem::path& path, const ToneMap& tone = {},
                    bool full_float = false);
/// 8-bit grey or RGB(A) PNG as linear 0..1 without tone curve (masks).
Result<Picture> ReadPng(const std::filesystem::path& path, const PictureLimits& limits = {});

}  // namespace glint
