#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "common/base/status.h"

namespace glint {

/// A linear RGBA picture, alpha = coverage (not premultiplied: background pixels are black anyway), top row first.
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

/// Reads OpenEXR (RGB or RGBA, any pixel type) or Radiance HDR (alpha 1). kBadInput/kLimit naming file and remedy.
Result<Picture> ReadPicture(const std::filesystem::path& path, const PictureLimits& limits = {});
Result<Picture> ReadPictureFromMemory(std::span<const std::byte> bytes, const std::string& name,
                                      const PictureLimits& limits = {});
/// By extension: .exr (half RGBA unless `full_float`), .hdr (RGBE), .png (tone-mapped, alpha kept).
Status WritePicture(const Picture& picture, const std::filesystem::path& path, const ToneMap& tone = {},
                    bool full_float = false);
/// 8-bit grey or RGB(A) PNG as linear 0..1 without tone curve (masks).
Result<Picture> ReadPng(const std::filesystem::path& path, const PictureLimits& limits = {});

}  // namespace glint
