// Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild: "FLIP: A Difference Evaluator for
// Alternating Images", 2020. Changed: the two-dimensional filters, all sums of products of one-dimensional
// ones, are applied along rows and columns in turn. Borders repeat the edge's pixels.

#include "common/render/flip.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

namespace glint {
namespace {

constexpr float kWhiteX = 0.950428545f, kWhiteZ = 1.088900371f;  ///< D65, Y = 1
constexpr float kColorPower = 0.7f;                              ///< q_c
constexpr float kShareOfMax = 0.4f, kShareOfRange = 0.95f;       ///< p_c and p_t of the error redistribution
constexpr float kFeatureWidthDeg = 0.082f, kFeaturePower = 0.5f;

using Plane = std::vector<float>;

struct Planes {
  Plane x, y, z;
};

glm::vec3 XyzFromLinear(const glm::vec3& c) {
  return {0.4123907993f * c.x + 0.3575843394f * c.y + 0.1804807884f * c.z,
          0.2126390059f * c.x + 0.7151686788f * c.y + 0.0721923154f * c.z,
          0.0193308187f * c.x + 0.1191947798f * c.y + 0.9505321522f * c.z};
}

glm::vec3 LinearFromXyz(const glm::vec3& c) {
  return {3.2409699419f * c.x - 1.5373831776f * c.y - 0.4986107603f * c.z,
          -0.9692436363f * c.x + 1.8759675015f * c.y + 0.0415550574f * c.z,
          0.0556300797f * c.x - 0.2039769589f * c.y + 1.0569715142f * c.z};
}

/// Linear opponent space: luminance, red-green, blue-yellow.
glm::vec3 YcxczFromXyz(const glm::vec3& c) {
  const float x = c.x / kWhiteX, z = c.z / kWhiteZ;
  return {116 * c.y - 16, 500 * (x - c.y), 200 * (c.y - z)};
}

glm::vec3 XyzFromYcxcz(const glm::vec3& c) {
  const float y = (c.x + 16) / 116;
  return {kWhiteX * (y + c.y / 500), y, kWhiteZ * (y - c.z / 200)};
}

/// L*a*b* with the chroma scaled by lightness (Hunt): colours look weaker in the dark.
glm::vec3 HuntLabFromXyz(const glm::vec3& c) {
  constexpr float kDelta = 6.0f / 29;
  const auto f = [](float t) {
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0f / 29;
  };
  const float x = f(c.x / kWhiteX), y = f(c.y), z = f(c.z / kWhiteZ);
  const float lightness = 116 * y - 16;
  return {lightness, 0.01f * lightness * 500 * (x - y), 0.01f * lightness * 200 * (y - z)};
}

float Hyab(const glm::vec3& a, const glm::vec3& b) {
  return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z);
}

int ClampIndex(int i, int n) { return std::clamp(i, 0, n - 1); }

/// out(x, y) = sum over i of kernel[i + radius] in(x + i, y), or along columns.
Plane Filtered(const Plane& in, int width, int height, const Plane& kernel, bool along_rows) {
  const int radius = static_cast<int>(kernel.size() / 2);
  Plane out(in.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      float sum = 0;
      for (int i = -radius; i <= radius; ++i) {
        const int sx = along_rows ? ClampIndex(x + i, width) : x,
                  sy = along_rows ? y : ClampIndex(y + i, height);
        sum += kernel[i + radius] * in[static_cast<size_t>(sy) * width + sx];
      }
      out[static_cast<size_t>(y) * width + x] = sum;
    }
  return out;
}

Plane Separable(const Plane& in, int width, int height, const Plane& rows, const Plane& columns) {
  return Filtered(Filtered(in, width, height, rows, true), width, height, columns, false);
}

float Sum(const Plane& kernel) {
  float sum = 0;
  for (const float k : kernel) sum += k;
  return sum;
}

/// One term a sqrt(pi / b) e^(-pi^2 r^2 / b) of a contrast sensitivity function in the spatial domain; r in
/// degrees.
struct CsfTerm {
  float a, b;
};

/// Filters by the sum of the terms, normalised as a whole.
Plane ContrastFiltered(const Plane& in, int width, int height, const std::vector<CsfTerm>& terms, float ppd) {
  constexpr float kWidestB = 0.04f, kPi = std::numbers::pi_v<float>;
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(kWidestB / (2 * kPi * kPi)) * ppd));
  Plane out(in.size(), 0.0f);
  float total = 0;
  for (const CsfTerm& term : terms) {
    Plane kernel(2 * radius + 1);
    for (int i = -radius; i <= radius; ++i) {
      const float r = static_cast<float>(i) / ppd;
      kernel[i + radius] = std::exp(-kPi * kPi * r * r / term.b);
    }
    const float scale = term.a * std::sqrt(kPi / term.b);
    total += scale * Sum(kernel) * Sum(kernel);
    const Plane part = Separable(in, width, height, kernel, kernel);
    for (size_t i = 0; i < out.size(); ++i) out[i] += scale * part[i];
  }
  for (float& value : out) value /= total;
  return out;
}

/// What an eye at the viewing distance keeps of the picture, in Hunt-adjusted L*a*b*.
std::vector<glm::vec3> Perceived(const Planes& opponent, int width, int height, float ppd) {
  const Plane y = ContrastFiltered(opponent.x, width, height, {{1, 0.0047f}}, ppd);
  const Plane cx = ContrastFiltered(opponent.y, width, height, {{1, 0.0053f}}, ppd);
  const Plane cz = ContrastFiltered(opponent.z, width, height, {{34.1f, 0.04f}, {13.5f, 0.025f}}, ppd);
  std::vector<glm::vec3> lab(y.size());
  for (size_t i = 0; i < lab.size(); ++i) {
    const glm::vec3 rgb = LinearFromXyz(XyzFromYcxcz({y[i], cx[i], cz[i]}));
    lab[i] = HuntLabFromXyz(XyzFromLinear(glm::clamp(rgb, 0.0f, 1.0f)));
  }
  return lab;
}

/// Maps the colour distance to [0, 1]: the lower part keeps most of the range, very large distances are
/// compressed.
float Redistributed(float distance, float largest) {
  const float knee = kShareOfMax * largest;
  if (distance < knee) return kShareOfRange / knee * distance;
  return kShareOfRange + (distance - knee) / (largest - knee) * (1 - kShareOfRange);
}

/// Distance between green and blue, the largest among colours of the display.
float LargestColorDistance() {
  const glm::vec3 green = HuntLabFromXyz(XyzFromLinear({0, 1, 0})),
                  blue = HuntLabFromXyz(XyzFromLinear({0, 0, 1}));
  return std::pow(Hyab(green, blue), kColorPower);
}

/// First and second derivatives of a Gaussian; positive and negative weights each sum to one.
struct FeatureKernels {
  Plane gauss, edge, point;
};

void BalanceSigns(Plane& kernel) {
  float positive = 0, negative = 0;
  for (const float k : kernel) (k > 0 ? positive : negative) += std::abs(k);
  for (float& k : kernel) k /= k > 0 ? positive : negative;
}

FeatureKernels MakeFeatureKernels(float ppd) {
  const float sigma = 0.5f * kFeatureWidthDeg * ppd;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  FeatureKernels kernels;
  for (int i = -radius; i <= radius; ++i) {
    const float x = static_cast<float>(i), g = std::exp(-x * x / (2 * sigma * sigma));
    kernels.gauss.push_back(g);
    kernels.edge.push_back(-x * g);
    kernels.point.push_back((x * x / (sigma * sigma) - 1) * g);
  }
  const float sum = Sum(kernels.gauss);
  for (float& g : kernels.gauss) g /= sum;
  BalanceSigns(kernels.edge);
  BalanceSigns(kernels.point);
  return kernels;
}

/// Strength of edges and of points at every pixel, of luminance in [0, 1].
struct Features {
  Plane edge, point;
};

Features FindFeatures(const Plane& opponent_y, int width, int height, float ppd) {
  Plane luminance(opponent_y.size());
  for (size_t i = 0; i < luminance.size(); ++i) luminance[i] = (opponent_y[i] + 16) / 116;
  const FeatureKernels k = MakeFeatureKernels(ppd);
  const auto strength = [&](const Plane& derivative) {
    Plane across = Separable(luminance, width, height, derivative, k.gauss);
    const Plane down = Separable(luminance, width, height, k.gauss, derivative);
    for (size_t i = 0; i < across.size(); ++i) across[i] = std::hypot(across[i], down[i]);
    return across;
  };
  return {strength(k.edge), strength(k.point)};
}

Planes Opponent(const std::vector<glm::vec3>& picture) {
  Planes planes{Plane(picture.size()), Plane(picture.size()), Plane(picture.size())};
  for (size_t i = 0; i < picture.size(); ++i) {
    const glm::vec3 c = YcxczFromXyz(XyzFromLinear(picture[i]));
    planes.x[i] = c.x, planes.y[i] = c.y, planes.z[i] = c.z;
  }
  return planes;
}

}  // namespace

std::vector<float> Flip(const std::vector<glm::vec3>& test, const std::vector<glm::vec3>& reference,
                        int width, int height, float pixels_per_degree) {
  const float ppd = pixels_per_degree;
  const Planes t = Opponent(test), r = Opponent(reference);
  const std::vector<glm::vec3> seen_t = Perceived(t, width, height, ppd),
                               seen_r = Perceived(r, width, height, ppd);
  const Features ft = FindFeatures(t.x, width, height, ppd), fr = FindFeatures(r.x, width, height, ppd);
  const float largest = LargestColorDistance();
  std::vector<float> flip(test.size());
  for (size_t i = 0; i < flip.size(); ++i) {
    const float color = Redistributed(std::pow(Hyab(seen_t[i], seen_r[i]), kColorPower), largest);
    const float difference = std::max(std::abs(ft.edge[i] - fr.edge[i]), std::abs(ft.point[i] - fr.point[i]));
    const float feature = std::min(1.0f, std::pow(difference / std::numbers::sqrt2_v<float>, kFeaturePower));
    flip[i] = std::clamp(std::pow(color, 1 - feature), 0.0f, 1.0f);
  }
  return flip;
}

}  // namespace glint
