#include "common/render/environment.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/base/frame.h"
#include "common/render/procedural_sky.h"

namespace glint {
namespace {

constexpr int kMinProceduralWidth = 16, kMaxProceduralWidth = 16384;
/// Samples per texel side of a procedural sky, against stairs at the edges of lights.
constexpr int kSkySubsamples = 3;

/// Turns increasing sums into a distribution that ends in exactly 1; all equal if there is nothing to choose.
void Normalize(double* cdf, int count) {
  const double total = cdf[count];
  for (int i = 1; i < count; ++i) cdf[i] = total > 0 ? cdf[i] / total : static_cast<double>(i) / count;
  cdf[count] = 1;
}

/// Interval of the distribution that holds `x` in [0, 1), never an empty one, and where in it x lies, in [0,
/// 1).
struct Choice {
  int index;
  double fraction;
};

Choice Choose(const double* cdf, int count, float x) {
  const double target = std::clamp(static_cast<double>(x), 0.0, 1 - 1e-9);
  const int index = static_cast<int>(std::upper_bound(cdf, cdf + count, target) - cdf) - 1;
  return {index, (target - cdf[index]) / (cdf[index + 1] - cdf[index])};
}

}  // namespace

glm::vec3 Environment::Direction(float u, float v) {
  const float longitude = (u - 0.5f) * 2 * kPi, latitude = (0.5f - v) * kPi;
  const float r = std::cos(latitude);
  return {r * std::cos(longitude), std::sin(latitude), r * std::sin(longitude)};
}

glm::vec2 Environment::Coordinates(const glm::vec3& d) {
  const glm::vec2 uv(0.5f + std::atan2(d.z, d.x) / (2 * kPi),
                     0.5f - std::asin(std::clamp(d.y, -1.0f, 1.0f)) / kPi);
  // A direction that is none must still name a texel: what follows makes indices of this.
  return {std::isnan(uv.x) ? 0.5f : uv.x, std::isnan(uv.y) ? 0.5f : uv.y};
}

Result<Environment> Environment::FromPicture(const Picture& picture, const std::string& name) {
  if (picture.width <= 0 || picture.height <= 0)
    return BadInput(name + ": the environment is an empty picture");
  Environment environment;
  environment.width_ = picture.width;
  environment.height_ = picture.height;
  environment.texels_.reserve(picture.pixels.size());
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    glm::vec3 texel(picture.pixels[i]);
    for (int c = 0; c < 3; ++c) {
      if (!std::isfinite(texel[c]))
        return BadInput(name + ": pixel (" + std::to_string(i % picture.width) + ", " +
                        std::to_string(i / picture.width) + ") is not finite; clamp or repaint it");
      if (texel[c] > kMaxRadiance)
        return BadInput(name + ": pixel (" + std::to_string(i % picture.width) + ", " +
                        std::to_string(i / picture.width) + ") is brighter than 1e15; clamp or repaint it");
      if (texel[c] < 0) {
        texel[c] = 0;
        ++environment.clamped_;
      }
    }
    environment.texels_.push_back(texel);
  }
  environment.BuildSampling();
  return environment;
}

Result<Environment> Environment::Load(const std::filesystem::path& path) {
  GLINT_ASSIGN_OR_RETURN(const Picture picture, ReadPicture(path));
  return FromPicture(picture, path.string());
}

Result<Environment> Environment::Procedural(const std::string& name, int width) {
  const SkyFunction sky = FindProceduralSky(name);
  if (sky == nullptr)
    return UsageError("procedural:" + name + ": there is no such sky; choose studio, sunset or uniform");
  if (width < kMinProceduralWidth || width > kMaxProceduralWidth)
    return UsageError("procedural:" + name + ": a width of " + std::to_string(width) + " is not in [" +
                      std::to_string(kMinProceduralWidth) + ", " + std::to_string(kMaxProceduralWidth) + "]");
  Picture picture(width, width / 2);
  const auto at = [](int texel, int sub, int count) {
    return (static_cast<float>(texel) + (static_cast<float>(sub) + 0.5f) / kSkySubsamples) /
           static_cast<float>(count);
  };
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < width; ++x) {
      glm::vec3 sum(0);
      for (int s = 0; s < kSkySubsamples * kSkySubsamples; ++s)
        sum += sky(Direction(at(x, s % kSkySubsamples, width), at(y, s / kSkySubsamples, picture.height)));
      picture.at(x, y) = glm::vec4(sum / static_cast<float>(kSkySubsamples * kSkySubsamples), 1);
    }
  return FromPicture(picture, "procedural:" + name);
}

Result<Environment> Environment::Open(const std::string& path_or_name) {
  const std::string prefix = "procedural:";
  if (path_or_name.starts_with(prefix)) return Procedural(path_or_name.substr(prefix.size()));
  return Load(path_or_name);
}

glm::vec3 Environment::Radiance(const glm::vec3& d) const {
  const glm::vec2 uv = Coordinates(d);
  const float x = uv.x * static_cast<float>(width_) - 0.5f;
  const float y =
      std::clamp(uv.y * static_cast<float>(height_) - 0.5f, 0.0f, static_cast<float>(height_ - 1));
  const float floor_x = std::floor(x), floor_y = std::floor(y);
  const float fx = x - floor_x, fy = y - floor_y;
  const auto wrap = [this](int i) { return i < 0 ? i + width_ : (i >= width_ ? i - width_ : i); };
  const int x0 = wrap(static_cast<int>(floor_x)), x1 = wrap(static_cast<int>(floor_x) + 1);
  const int y0 = static_cast<int>(floor_y), y1 = std::min(y0 + 1, height_ - 1);
  const glm::vec3* top = &texels_[static_cast<size_t>(y0) * width_];
  const glm::vec3* bottom = &texels_[static_cast<size_t>(y1) * width_];
  return (top[x0] * (1 - fx) + top[x1] * fx) * (1 - fy) + (bottom[x0] * (1 - fx) + bottom[x1] * fx) * fy;
}

void Environment::BuildSampling() {
  const int w = width_, h = height_;
  sine_edges_.resize(h + 1);
  for (int j = 0; j <= h; ++j)
    sine_edges_[j] = std::sin((0.5 - static_cast<double>(j) / h) * std::numbers::pi);
  sine_edges_[0] = 1, sine_edges_[h] = -1;

  const auto luminance = [&](int x, int y) {
    return static_cast<double>(Luminance(texels_[size_t(y) * w + x]));
  };
  row_cdf_.assign(h + 1, 0);
  column_cdf_.assign(static_cast<size_t>(h) * (w + 1), 0);
  std::vector<double> row(w);
  for (int j = 0; j < h; ++j) {
    // The mean of a bilinear interpolant over a texel is (1, 6, 1) / 8 of the neighbours along either axis.
    for (int i = 0; i < w; ++i)
      row[i] =
          (luminance(i, std::max(j - 1, 0)) + 6 * luminance(i, j) + luminance(i, std::min(j + 1, h - 1))) / 8;
    double* cdf = &column_cdf_[static_cast<size_t>(j) * (w + 1)];
    for (int i = 0; i < w; ++i)
      cdf[i + 1] = cdf[i] + (row[i == 0 ? w - 1 : i - 1] + 6 * row[i] + row[i == w - 1 ? 0 : i + 1]) / 8;
    row_cdf_[j + 1] = row_cdf_[j] + cdf[w] * (sine_edges_[j] - sine_edges_[j + 1]);
    Normalize(cdf, w);
  }
  if (row_cdf_[h] <= 0)  // a black map: by solid angle
    for (int j = 0; j <= h; ++j) row_cdf_[j] = 1 - sine_edges_[j];
  Normalize(row_cdf_.data(), h);
}

Environment::Sample Environment::SampleDirection(float u, float v) const {
  const Choice row = Choose(row_cdf_.data(), height_, v);
  const double* cdf = &column_cdf_[static_cast<size_t>(row.index) * (width_ + 1)];
  const Choice column = Choose(cdf, width_, u);
  const double y =
      sine_edges_[row.index] + row.fraction * (sine_edges_[row.index + 1] - sine_edges_[row.index]);
  const double longitude = ((column.index + column.fraction) / width_ - 0.5) * 2 * std::numbers::pi;
  const double r = std::sqrt(std::max(0.0, 1 - y * y));
  const double solid_angle =
      (sine_edges_[row.index] - sine_edges_[row.index + 1]) * 2 * std::numbers::pi / width_;
  const double probability =
      (row_cdf_[row.index + 1] - row_cdf_[row.index]) * (cdf[column.index + 1] - cdf[column.index]);
  return {glm::vec3(r * std::cos(longitude), y, r * std::sin(longitude)),
          static_cast<float>(probability / solid_angle)};
}

float Environment::Pdf(const glm::vec3& d) const {
  const glm::vec2 uv = Coordinates(d);
  const int x = std::clamp(static_cast<int>(uv.x * static_cast<float>(width_)), 0, width_ - 1);
  const int y = std::clamp(static_cast<int>(uv.y * static_cast<float>(height_)), 0, height_ - 1);
  const double* cdf = &column_cdf_[static_cast<size_t>(y) * (width_ + 1)];
  const double solid_angle = (sine_edges_[y] - sine_edges_[y + 1]) * 2 * std::numbers::pi / width_;
  return static_cast<float>((row_cdf_[y + 1] - row_cdf_[y]) * (cdf[x + 1] - cdf[x]) / solid_angle);
}

glm::vec3 RotateForLookup(const glm::vec3& d, float degrees) {
  // Whole turns first: they keep the digits of a large angle, and what is no angle turns nothing.
  const float turn = std::isfinite(degrees) ? std::remainder(degrees, 360.0f) : 0.0f;
  const float radians = -turn * kPi / 180, c = std::cos(radians), s = std::sin(radians);
  return {c * d.x + s * d.z, d.y, c * d.z - s * d.x};
}

}  // namespace glint
