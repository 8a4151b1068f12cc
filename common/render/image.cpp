#include "common/render/image.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "common/base/files.h"
#include "common/base/frame.h"
#include "common/base/srgb.h"
#include "common/render/image_codecs.h"

namespace glint {
namespace {

bool StartsWith(std::span<const std::byte> bytes, std::span<const unsigned char> magic) {
  return bytes.size() >= magic.size() &&
         std::equal(magic.begin(), magic.end(), bytes.begin(),
                    [](unsigned char a, std::byte b) { return std::byte{a} == b; });
}

std::string LowerExtension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

Result<std::vector<std::byte>> Encode(const Picture& picture, const std::filesystem::path& path,
                                      const ToneMap& tone, bool full_float) {
  const std::string extension = LowerExtension(path);
  if (extension == ".exr") return codec::EncodeExr(picture, path.string(), full_float);
  if (extension == ".hdr") return codec::EncodeHdr(picture);
  if (extension == ".png") return codec::EncodePng(picture, path.string(), tone);
  return UsageError(path.string() +
                    ": pictures are written as .exr, .hdr or .png; choose one of these extensions");
}

}  // namespace

namespace codec {

Status CheckSize(int64_t width, int64_t height, const PictureLimits& limits, const std::string& name) {
  const std::string size = std::to_string(width) + " x " + std::to_string(height);
  if (width <= 0 || height <= 0)
    return BadInput(name + ": the picture is empty (" + size + "); write it again");
  if (width > limits.side || height > limits.side)
    return LimitExceeded(name + ": " + size + " pixels, but a side may have at most " +
                         std::to_string(limits.side) + "; scale the picture down");
  if (static_cast<uint64_t>(width) * static_cast<uint64_t>(height) > limits.pixels)
    return LimitExceeded(name + ": " + size + " pixels, but at most " + std::to_string(limits.pixels) +
                         " are accepted; scale the picture down");
  return {};
}

}  // namespace codec

float LinearToSrgb(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

float SrgbToLinear(float encoded) { return static_cast<float>(SrgbDecode(encoded)); }

Status CheckTone(const ToneMap& tone) {
  if (tone.exposure > 0 && std::isfinite(tone.exposure)) return {};
  return UsageError("exposure " + std::to_string(tone.exposure) + ": must be a positive number, such as 1");
}

glm::vec3 ToneMapped(const glm::vec3& radiance, const ToneMap& tone) {
  glm::vec3 c = radiance * tone.exposure;
  // Written so that NaN fails the comparison; the upper bound keeps infinity / infinity out of the curve
  // below.
  for (int i = 0; i < 3; ++i) c[i] = c[i] > 0 ? std::min(c[i], 1e18f) : 0.0f;
  if (tone.reinhard) c /= 1 + Luminance(c);
  for (int i = 0; i < 3; ++i) c[i] = std::min(c[i], 1.0f);
  return c;
}

Result<Picture> ReadPictureFromMemory(std::span<const std::byte> bytes, const std::string& name,
                                      const PictureLimits& limits) {
  constexpr std::array<unsigned char, 4> kExr{0x76, 0x2f, 0x31, 0x01};
  constexpr std::array<unsigned char, 2> kHdr{'#', '?'};
  if (bytes.size() > limits.file_bytes)
    return LimitExceeded(name + ": larger than " + std::to_string(limits.file_bytes) +
                         " bytes; scale the picture down");
  if (StartsWith(bytes, kExr)) return codec::DecodeExr(bytes, name, limits);
  if (StartsWith(bytes, kHdr)) return codec::DecodeHdr(bytes, name, limits);
  return BadInput(name + ": neither OpenEXR nor Radiance HDR; convert the picture to one of them");
}

Result<Picture> ReadPicture(const std::filesystem::path& path, const PictureLimits& limits) {
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, limits.file_bytes));
  return ReadPictureFromMemory(bytes, path.string(), limits);
}

Result<Picture> ReadPng(const std::filesystem::path& path, const PictureLimits& limits) {
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, limits.file_bytes));
  return codec::DecodePng(bytes, path.string(), limits);
}

Status WritePicture(const Picture& picture, const std::filesystem::path& path, const ToneMap& tone,
                    bool full_float) {
  if (picture.width <= 0 || picture.height <= 0 ||
      picture.pixels.size() != static_cast<size_t>(picture.width) * picture.height)
    return BadInput(path.string() + ": the picture to write is empty or its size does not match its pixels");
  GLINT_RETURN_IF_ERROR(CheckTone(tone));
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, Encode(picture, path, tone, full_float));
  return PublishFile(path, bytes);
}

}  // namespace glint
