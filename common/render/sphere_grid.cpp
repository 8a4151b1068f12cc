// Convolution of an environment with vMF lobes by direct summation on latitude-longitude grids.
//
// Between an output row at latitude a and a source row at latitude b the lobe depends on the difference of
// longitudes alone, mu.s - 1 = (cos(a - b) - 1) + cos a cos b (cos(dphi) - 1): one row of weights serves all
// columns, and the inner loop is a sum of shifted rows. The nodes stand half a standard deviation of the lobe
// apart (or at the environment's texels, if these are coarser), which is close enough for all smearing to be
// counted in second moments: the grid's nodes take (spacing^2 / 4) from the lobe's variance 1 / kappa, the
// environment's bilinear filter adds h^2 / 6.

#include "common/render/sphere_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <numbers>

#include "common/base/parallel.h"

namespace glint {
namespace {

constexpr double kDoublePi = std::numbers::pi;
constexpr int kMinWidth = 128, kMinHeight = 64;
/// Weights below e^-12 = 6e-6 of the lobe's peak are left out.
constexpr double kCutoff = 12;
/// Columns that one pass of the inner loop keeps in registers.
constexpr int kBlock = 32;

double Latitude(int row, int height) { return (0.5 - (row + 0.5) / height) * kDoublePi; }

/// Integral of cos(latitude) over [a, b] (either order) times a weight that falls from 1 at a to 0 at b.
double FallingCosine(double a, double b) {
  return std::abs((std::cos(a) - std::cos(b)) / (b - a) - std::sin(a));
}

/// Solid angle that counts for one texel of a row, radiance being bilinear and constant beyond the outermost
/// centres.
std::vector<double> BilinearSolidAngles(int width, int height) {
  std::vector<double> result(height);
  for (int j = 0; j < height; ++j) {
    const double a = Latitude(j, height);
    const double up = j == 0 ? 1 - std::sin(a) : FallingCosine(a, Latitude(j - 1, height));
    const double down = j == height - 1 ? 1 + std::sin(a) : FallingCosine(a, Latitude(j + 1, height));
    result[j] = (up + down) * 2 * kDoublePi / width;
  }
  return result;
}

Environment Resampled(const Environment& environment, int width, int height) {
  Picture picture(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const float u = (static_cast<float>(x) + 0.5f) / static_cast<float>(width);
      const float v = (static_cast<float>(y) + 0.5f) / static_cast<float>(height);
      picture.at(x, y) = glm::vec4(environment.Radiance(Environment::Direction(u, v)), 1);
    }
  // Bilinear means of finite, non-negative texels are finite and non-negative, which is all that is asked
  // for.
  return Environment::FromPicture(picture, "resampled").value();
}

/// The three nodes, from `first` on, and shares of a mass at position `x` (in nodes, centres at integers).
struct Spline {
  int first;
  std::array<float, 3> share;
};

Spline QuadraticSpline(double x) {
  const double nearest = std::floor(x + 0.5), f = x - nearest;
  return {static_cast<int>(nearest) - 1,
          {static_cast<float>(0.5 * (0.5 - f) * (0.5 - f)), static_cast<float>(0.75 - f * f),
           static_cast<float>(0.5 * (0.5 + f) * (0.5 + f))}};
}

std::vector<Spline> Splines(int from, int to) {
  std::vector<Spline> splines(from);
  for (int i = 0; i < from; ++i) splines[i] = QuadraticSpline((i + 0.5) / from * to - 0.5);
  return splines;
}

int Wrap(int i, int n) { return i < 0 ? i + n : (i >= n ? i - n : i); }

/// Row reached across a pole, and whether it lies on the other side, half a turn away.
struct Reflected {
  int row;
  bool opposite;
};

Reflected AcrossPole(int row, int height) {
  if (row < 0) return {-1 - row, true};
  if (row >= height) return {2 * height - 1 - row, true};
  return {row, false};
}

/// out[x] += sum over k in [low, high] of weight[|k|] * source[x + k], x in [0, count); count a multiple of
/// kBlock.
void AddShiftedRows(const float* source, const float* weight, int low, int high, int count, float* out) {
  constexpr int kVectors = kBlock / 4;
  for (int x = 0; x < count; x += kBlock) {
    Float4 sum[kVectors];  // unrolled, so that it lives in registers
#pragma GCC unroll 8
    for (int i = 0; i < kVectors; ++i) sum[i] = LoadFloat4(out + x + 4 * i);
    for (int k = low; k <= high; ++k) {
      const float w = weight[std::abs(k)];
      const float* shifted = source + x + k;
#pragma GCC unroll 8
      for (int i = 0; i < kVectors; ++i) sum[i] += LoadFloat4(shifted + 4 * i) * w;
    }
    std::memcpy(out + x, sum, sizeof sum);
  }
}

/// Lagrange's weights of six nodes at -2 .. 3 for a position f in [0, 1).
std::array<float, 6> LagrangeWeights(float f) {
  const float a = f + 2, b = f + 1, c = f, d = f - 1, e = f - 2, g = f - 3;
  return {-b * c * d * e * g / 120, a * c * d * e * g / 24,  -a * b * d * e * g / 12,
          a * b * c * e * g / 12,   -a * b * c * d * g / 24, a * b * c * d * e / 120};
}

}  // namespace

SphereMasses SphereMasses::FromEnvironment(const Environment& environment) {
  if (environment.width() < kMinWidth || environment.height() < kMinHeight)
    return FromEnvironment(Resampled(environment, std::max(environment.width(), kMinWidth),
                                     std::max(environment.height(), kMinHeight)));
  SphereMasses masses;
  const int w = masses.width_ = environment.width(), h = masses.height_ = environment.height();
  masses.solid_angle_ = BilinearSolidAngles(w, h);
  for (int c = 0; c < 3; ++c) {
    masses.mass_[c].resize(static_cast<size_t>(w) * h);
    for (size_t i = 0; i < masses.mass_[c].size(); ++i)
      masses.mass_[c][i] = environment.texels()[i][c] * static_cast<float>(masses.solid_angle_[i / w]);
  }
  const double latitude = kDoublePi / h, longitude = 2 * kDoublePi / w;
  masses.excess_latitude_ = -latitude * latitude / 6;
  masses.excess_longitude_ = -longitude * longitude / 6;
  return masses;
}

SphereMasses SphereMasses::Coarsened(const SphereMasses& fine, int width, int height) {
  if (width == fine.width_ && height == fine.height_) return fine;
  SphereMasses coarse;
  coarse.width_ = width;
  coarse.height_ = height;
  coarse.solid_angle_.assign(height, 0);
  const std::vector<Spline> columns = Splines(fine.width_, width), rows = Splines(fine.height_, height);
  for (int j = 0; j < fine.height_; ++j)
    for (int t = 0; t < 3; ++t)
      coarse.solid_angle_[AcrossPole(rows[j].first + t, height).row] +=
          rows[j].share[t] * fine.solid_angle_[j] * fine.width_ / width;

  std::vector<float> row(width);
  for (int c = 0; c < 3; ++c) {
    coarse.mass_[c].assign(static_cast<size_t>(width) * height, 0);
    for (int j = 0; j < fine.height_; ++j) {
      std::fill(row.begin(), row.end(), 0.0f);
      for (int i = 0; i < fine.width_; ++i) {
        const float mass = fine.mass_[c][static_cast<size_t>(j) * fine.width_ + i];
        for (int t = 0; t < 3; ++t) row[Wrap(columns[i].first + t, width)] += mass * columns[i].share[t];
      }
      for (int t = 0; t < 3; ++t) {
        const Reflected target = AcrossPole(rows[j].first + t, height);
        float* out = &coarse.mass_[c][static_cast<size_t>(target.row) * width];
        const int turn = target.opposite ? width / 2 : 0;
        for (int i = 0; i < width; ++i) out[Wrap(i + turn, width)] += row[i] * rows[j].share[t];
      }
    }
  }
  const double latitude = kDoublePi / height, longitude = 2 * kDoublePi / width;
  coarse.excess_latitude_ = fine.excess_latitude_ + latitude * latitude / 4;
  coarse.excess_longitude_ = fine.excess_longitude_ + longitude * longitude / 4;
  return coarse;
}

glm::vec3 SphereMasses::Mean() const {
  double solid_angle = 0;
  for (const double row : solid_angle_) solid_angle += row * width_;
  glm::vec3 mean;
  for (int c = 0; c < 3; ++c) {
    double sum = 0;
    for (const float mass : mass_[c]) sum += mass;
    mean[c] = static_cast<float>(sum / solid_angle);
  }
  return mean;
}

SphereConvolution::SphereConvolution(const SphereMasses& masses, double kappa, int threads)
    : width_(masses.width_), height_(masses.height_) {
  nodes_.assign(static_cast<size_t>(width_ + 2 * kPad) * (height_ + 2 * kPad), glm::vec4(0));
  // Rows continued by half a turn and a block on either side: shifting needs no wrapping.
  const int stride = 2 * width_ + kBlock;
  std::vector<float> extended[3];
  for (int c = 0; c < 3; ++c) {
    extended[c].resize(static_cast<size_t>(stride) * height_);
    for (int j = 0; j < height_; ++j)
      for (int t = 0; t < stride; ++t)
        extended[c][static_cast<size_t>(j) * stride + t] =
            masses.mass_[c][static_cast<size_t>(j) * width_ + (t + width_ - width_ / 2) % width_];
  }
  ParallelFor(height_, threads, 1,
              [&](size_t row, int) { ConvolveRow(masses, kappa, extended, static_cast<int>(row)); });
  WrapPadding();
}

void SphereConvolution::ConvolveRow(const SphereMasses& masses, double kappa,
                                    const std::vector<float>* extended, int row) {
  const int half = width_ / 2, stride = 2 * width_ + kBlock;
  const int padded = (width_ + kBlock - 1) / kBlock * kBlock;
  const double a = Latitude(row, height_);
  const double kappa_latitude = 1 / (1 / kappa - masses.excess_latitude_);
  std::vector<float> sum[3], weight(half + 1);
  for (std::vector<float>& channel : sum) channel.assign(padded, 0.0f);
  double norm = 0;
  for (int j = 0; j < height_; ++j) {
    const double b = Latitude(j, height_);
    const double across = kappa_latitude * (std::cos(a - b) - 1);
    if (across < -kCutoff) continue;
    const double cosines = std::cos(a) * std::cos(b);
    const double kappa_longitude = cosines / (1 / kappa - masses.excess_longitude_ * cosines);
    const double least_cosine = 1 - (kCutoff + across) / kappa_longitude;
    const double reach = least_cosine <= -1 ? kDoublePi : std::acos(least_cosine);
    const int high = std::min(half, static_cast<int>(reach * width_ / (2 * kDoublePi)));
    const int low = -std::min(high, width_ - half - 1);
    double weights = 0;
    for (int k = 0; k <= high; ++k) {
      const double along = kappa_longitude * (std::cos(2 * kDoublePi * k / width_) - 1);
      weight[k] = std::exp(static_cast<float>(across + along));
      weights += weight[k] * (k == 0 || -k < low ? 1.0 : 2.0);
    }
    norm += weights * masses.solid_angle_[j];
    for (int c = 0; c < 3; ++c)
      AddShiftedRows(extended[c].data() + static_cast<size_t>(j) * stride + half, weight.data(), low, high,
                     padded, sum[c].data());
  }
  const float scale = static_cast<float>(1 / norm);
  for (int x = 0; x < width_; ++x) node(x, row) = glm::vec4(sum[0][x], sum[1][x], sum[2][x], 0) * scale;
}

void SphereConvolution::WrapPadding() {
  for (int y = -kPad; y < height_ + kPad; ++y) {
    const Reflected source = AcrossPole(y, height_);
    if (source.opposite)
      for (int x = 0; x < width_; ++x) node(x, y) = node(Wrap(x + width_ / 2, width_), source.row);
    for (int i = 1; i <= kPad; ++i) {
      node(-i, y) = node(width_ - i, y);
      node(width_ - 1 + i, y) = node(i - 1, y);
    }
  }
}

glm::vec3 SphereConvolution::At(float u, float v) const {
  // Positions may reach half a node beyond the outermost centres, never further: the padding is enough.
  const float x = std::clamp(u * static_cast<float>(width_) - 0.5f, -0.5f, static_cast<float>(width_) - 0.5f);
  const float y =
      std::clamp(v * static_cast<float>(height_) - 0.5f, -0.5f, static_cast<float>(height_) - 0.5f);
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  const std::array<float, 6> wx = LagrangeWeights(x - static_cast<float>(ix));
  const std::array<float, 6> wy = LagrangeWeights(y - static_cast<float>(iy));
  const size_t stride = static_cast<size_t>(width_) + 2 * kPad;
  const glm::vec4* row =
      &nodes_[static_cast<size_t>(iy + kPad - 2) * stride + static_cast<size_t>(ix + kPad - 2)];
  Float4 sum{};
  for (int j = 0; j < 6; ++j, row += stride) {
    Float4 line{};
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i) line += LoadFloat4(row[i]) * wx[i];
    sum += line * wy[j];
  }
  return glm::max(ToVec3(sum), glm::vec3(0));
}

}  // namespace glint
