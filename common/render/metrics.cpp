#include "common/render/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/render/flip.h"

namespace glint {
namespace {

/// eps of the relative measures, as a part of the reference's mean.
constexpr double kEpsilonShare = 0.1;
constexpr double kMaxPsnr = 200;  ///< stands for "identical"

Status CheckSameSize(const Picture& test, const Picture& reference, const std::string& what) {
  if (test.width == reference.width && test.height == reference.height && test.width > 0 && test.height > 0)
    return {};
  return BadInput(what + ": sizes differ or are empty (" + std::to_string(test.width) + " x " +
                  std::to_string(test.height) + " against " + std::to_string(reference.width) + " x " +
                  std::to_string(reference.height) + "); render both pictures with one --size");
}

Status CheckFinite(const Picture& picture, const std::string& what) {
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    const glm::vec4& p = picture.pixels[i];
    if (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z) && std::isfinite(p.w)) continue;
    return BadInput(what + ": pixel (" + std::to_string(i % picture.width) + ", " +
                    std::to_string(i / picture.width) + ") is not finite; make the picture again");
  }
  return {};
}

Status CheckComparable(const Picture& test, const Picture& reference, const std::string& what) {
  GLINT_RETURN_IF_ERROR(CheckSameSize(test, reference, what));
  GLINT_RETURN_IF_ERROR(CheckFinite(test, what + ": the picture to judge"));
  return CheckFinite(reference, what + ": the reference");
}

/// Pixels that count: the mask's, else the covered ones, else all.
std::vector<bool> Counted(const Picture& reference, const Picture* mask) {
  std::vector<bool> counted(reference.pixels.size());
  bool any = false;
  for (size_t i = 0; i < counted.size(); ++i) {
    counted[i] = mask != nullptr ? mask->pixels[i].x > 0.5f : reference.pixels[i].w > 0;
    any = any || counted[i];
  }
  if (mask == nullptr && !any) counted.assign(counted.size(), true);
  return counted;
}

struct Cells {
  std::vector<glm::vec3> test, reference;
};

/// Counted pixels, or means over the counted pixels of each block. A partial block at the border is a block
/// as well.
Cells Gather(const Picture& test, const Picture& reference, const std::vector<bool>& counted, int block) {
  Cells cells;
  for (int by = 0; by < reference.height; by += block)
    for (int bx = 0; bx < reference.width; bx += block) {
      glm::dvec3 t(0), r(0);  // sums of floats that are only just finite
      int n = 0;
      for (int y = by; y < std::min(by + block, reference.height); ++y)
        for (int x = bx; x < std::min(bx + block, reference.width); ++x) {
          if (!counted[static_cast<size_t>(y) * reference.width + x]) continue;
          t += glm::dvec3(test.at(x, y));
          r += glm::dvec3(reference.at(x, y));
          ++n;
        }
      if (n == 0) continue;
      cells.test.emplace_back(t / static_cast<double>(n));
      cells.reference.emplace_back(r / static_cast<double>(n));
    }
  return cells;
}

double MeanChannel(const std::vector<glm::vec3>& cells) {
  double sum = 0;
  for (const glm::vec3& c : cells) sum += static_cast<double>(c.x) + c.y + c.z;
  return cells.empty() ? 0 : sum / (3.0 * static_cast<double>(cells.size()));
}

/// A black reference has no scale: then differences count against 1.
double Epsilon(double mean_reference) { return mean_reference > 0 ? kEpsilonShare * mean_reference : 1; }

void RelativeErrors(const Cells& cells, Comparison& result) {
  const double eps = Epsilon(result.mean_reference);
  double square = 0, absolute = 0;
  for (size_t i = 0; i < cells.test.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const double t = cells.test[i][c], r = cells.reference[i][c], d = t - r;
      square += d * d / (r * r + eps * eps);
      absolute += std::abs(d) / (std::abs(r) + eps);
    }
  const double n = 3.0 * static_cast<double>(cells.test.size());
  result.rel_mse = square / n;
  result.mean_relative = absolute / n;
}

glm::vec3 Encoded(const glm::vec3& radiance, const ToneMap& tone) {
  const glm::vec3 linear = ToneMapped(radiance, tone);
  return {LinearToSrgb(linear.x), LinearToSrgb(linear.y), LinearToSrgb(linear.z)};
}

double Psnr(const Cells& cells, const ToneMap& tone) {
  double square = 0;
  for (size_t i = 0; i < cells.test.size(); ++i) {
    const glm::vec3 d = Encoded(cells.test[i], tone) - Encoded(cells.reference[i], tone);
    square += static_cast<double>(glm::dot(d, d));
  }
  const double mse = square / (3.0 * static_cast<double>(cells.test.size()));
  return mse > 0 ? std::min(kMaxPsnr, -10 * std::log10(mse)) : kMaxPsnr;
}

double MeanCounted(const std::vector<float>& map, const std::vector<bool>& counted) {
  double sum = 0;
  uint64_t n = 0;
  for (size_t i = 0; i < map.size(); ++i)
    if (counted[i]) sum += map[i], ++n;
  return n == 0 ? 0 : sum / static_cast<double>(n);
}

std::vector<glm::vec3> Display(const Picture& picture, const ToneMap& tone) {
  std::vector<glm::vec3> display(picture.pixels.size());
  for (size_t i = 0; i < display.size(); ++i) display[i] = ToneMapped(glm::vec3(picture.pixels[i]), tone);
  return display;
}

/// Dark blue over violet, red and orange to pale yellow; lightness rises evenly. t in [0, 1], sRGB.
glm::vec3 HeatColor(float t) {
  static constexpr std::array<std::array<float, 3>, 7> kSrgb{{{0.01f, 0.01f, 0.06f},
                                                              {0.16f, 0.06f, 0.38f},
                                                              {0.41f, 0.09f, 0.48f},
                                                              {0.67f, 0.18f, 0.42f},
                                                              {0.89f, 0.34f, 0.27f},
                                                              {0.98f, 0.61f, 0.20f},
                                                              {0.98f, 0.96f, 0.70f}}};
  const float x = std::clamp(t, 0.0f, 1.0f) * static_cast<float>(kSrgb.size() - 1);
  const size_t i = std::min(static_cast<size_t>(x), kSrgb.size() - 2);
  const float f = x - static_cast<float>(i);
  glm::vec3 color;
  for (size_t c = 0; c < 3; ++c) color[static_cast<int>(c)] = kSrgb[i][c] * (1 - f) + kSrgb[i + 1][c] * f;
  return color;
}

}  // namespace

Result<Comparison> Compare(const Picture& test, const Picture& reference, const CompareOptions& options) {
  GLINT_RETURN_IF_ERROR(CheckComparable(test, reference, "comparison"));
  if (options.mask != nullptr) GLINT_RETURN_IF_ERROR(CheckSameSize(*options.mask, reference, "mask"));
  GLINT_RETURN_IF_ERROR(CheckTone(options.tone));
  if (options.block < 1) return UsageError("comparison: the block's side must be at least 1");
  const std::vector<bool> counted = Counted(reference, options.mask);
  const Cells cells = Gather(test, reference, counted, options.block);
  if (cells.test.empty()) return BadInput("comparison: the mask counts no pixel; use another mask");

  Comparison result;
  result.pixels = static_cast<uint64_t>(std::count(counted.begin(), counted.end(), true));
  result.mean_test = MeanChannel(cells.test);
  result.mean_reference = MeanChannel(cells.reference);
  RelativeErrors(cells, result);
  result.psnr_db = Psnr(cells, options.tone);
  GLINT_ASSIGN_OR_RETURN(const std::vector<float> flip, FlipMap(test, reference, options.tone));
  result.flip = MeanCounted(flip, counted);
  return result;
}

Result<std::vector<float>> FlipMap(const Picture& test, const Picture& reference, const ToneMap& tone) {
  GLINT_RETURN_IF_ERROR(CheckComparable(test, reference, "FLIP"));
  GLINT_RETURN_IF_ERROR(CheckTone(tone));
  return Flip(Display(test, tone), Display(reference, tone), reference.width, reference.height,
              kFlipPixelsPerDegree);
}

Result<Picture> FalseColorDifference(const Picture& test, const Picture& reference, const Picture* mask) {
  GLINT_RETURN_IF_ERROR(CheckComparable(test, reference, "difference picture"));
  if (mask != nullptr) GLINT_RETURN_IF_ERROR(CheckSameSize(*mask, reference, "mask"));
  const std::vector<bool> counted = Counted(reference, mask);
  const double eps = Epsilon(MeanChannel(Gather(test, reference, counted, 1).reference));
  Picture picture(reference.width, reference.height);
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    if (mask != nullptr && !counted[i]) continue;
    double sum = 0;
    for (int c = 0; c < 3; ++c) {
      const double t = test.pixels[i][c], r = reference.pixels[i][c];
      sum += std::abs(t - r) / (std::abs(r) + eps);
    }
    picture.pixels[i] = glm::vec4(HeatColor(static_cast<float>(sum / 3)), 1);
  }
  return picture;
}

}  // namespace glint
