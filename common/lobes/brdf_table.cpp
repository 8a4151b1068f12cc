#include "common/lobes/brdf_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/base/frame.h"
#include "common/lobes/vmf.h"

namespace glint {
namespace {

// Newton's square root, for tables made at compile time; x in [0, 1], converged well before the last round.
constexpr double RootAtCompileTime(double x) {
  double y = 1;
  for (int i = 0; i < 60; ++i) y = 0.5 * (y + x / y);
  return y;
}

// cos and sin of every node, so that a look-up needs no trigonometry.
struct NodeAngles {
  std::array<float, kElevationNodes> cos{}, sin{};
};

constexpr NodeAngles kNodes = [] {
  NodeAngles n;
  for (int i = 0; i < kElevationNodes; ++i) {
    const double c = ElevationNode(i);
    n.cos[i] = ElevationNode(i);
    n.sin[i] = static_cast<float>(RootAtCompileTime((1 - c) * (1 + c)));
  }
  return n;
}();

// Node below cos_o and the way to the next, in [0, 1].
struct NodePosition {
  int node;
  float t;
};

NodePosition FindNode(float cos_o) {
  const int node = std::min(static_cast<int>(std::sqrt(cos_o) * (kElevationNodes - 1)), kElevationNodes - 2);
  const float t = (cos_o - kNodes.cos[node]) / (kNodes.cos[node + 1] - kNodes.cos[node]);
  return {node, std::clamp(t, 0.0f, 1.0f)};
}

// 1 - (1 - v.h)^5 against the cosine lobe over wi, by midpoints over the disc that the cosine makes uniform.
float DiffuseTransmission(float cos_o) {
  constexpr int kGrid = 48;
  const double sin_o = std::sqrt(1 - double{cos_o} * cos_o);
  double sum = 0;
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j) {
      const double u = (i + 0.5) / kGrid, phi = static_cast<double>(kPi) * (j + 0.5) / kGrid;
      const double cosine = sin_o * std::sqrt(u) * std::cos(phi) + cos_o * std::sqrt(1 - u);
      sum += 1 - std::pow(1 - std::sqrt(std::max(0.0, 0.5 * (1 + cosine))), 5);
    }
  return static_cast<float>(sum / (kGrid * kGrid));
}

const std::array<float, kElevationNodes>& TransmissionTable() {
  static const std::array<float, kElevationNodes> table = [] {
    std::array<float, kElevationNodes> t;
    for (int i = 0; i < kElevationNodes; ++i) t[i] = DiffuseTransmission(ElevationNode(i));
    return t;
  }();
  return table;
}

// A slice turned into the plane of wo: the mixture that Evaluate, Sample and Pdf share.
struct LobeModel {
  BrdfSlice slice;
  glm::vec3 diffuse{0};
  std::array<Vmf, kMaxBrdfLobes> vmf{};
  std::array<glm::vec3, kMaxBrdfLobes> weight{};
  std::array<float, kMaxBrdfLobes> share{};  // of the sampler, sums to 1 with the cosine lobe's
  float diffuse_share = 0;
};

LobeModel MakeLobeModel(const Brdf& brdf, const BrdfShape& shape, const glm::vec3& wo) {
  LobeModel m;
  m.slice = LookupSlice(shape, wo.z);
  m.diffuse = DiffuseAlbedo(brdf, wo.z);
  const float length = std::hypot(wo.x, wo.y);
  const float cos_phi = length > 1e-8f ? wo.x / length : 1, sin_phi = length > 1e-8f ? wo.y / length : 0;
  float sum = m.diffuse_share = Luminance(m.diffuse);
  for (int k = 0; k < m.slice.lobes; ++k) {
    const BrdfLobe& lobe = m.slice.lobe[k];
    m.vmf[k] = {{lobe.mu_x * cos_phi, lobe.mu_x * sin_phi, lobe.mu_z}, lobe.kappa};
    m.weight[k] = lobe.Weight(brdf.specular);
    m.share[k] = Luminance(m.weight[k]);
    sum += m.share[k];
  }
  const float inverse = sum > 0 ? 1 / sum : 0;
  m.diffuse_share *= inverse;
  for (float& share : m.share) share *= inverse;
  return m;
}

// Value and density at wi above the surface. A lobe's samples below are lost, so its density is not divided
// by `above`.
struct ModelValue {
  glm::vec3 value{0};
  float pdf = 0;
};

ModelValue Evaluate(const LobeModel& m, const glm::vec3& wi) {
  ModelValue out{m.diffuse * (wi.z / kPi), m.diffuse_share * wi.z / kPi};
  for (int k = 0; k < m.slice.lobes; ++k) {
    const float density = VmfPdf(m.vmf[k], wi);
    out.value += m.weight[k] * (density / m.slice.lobe[k].above);
    out.pdf += m.share[k] * density;
  }
  return out;
}

}  // namespace

BrdfSlice LookupSlice(const BrdfShape& shape, float cos_o) {
  const float c = std::clamp(cos_o, kMinCosine, 1.0f), s = std::sqrt((1 - c) * (1 + c));
  const auto [node, t] = FindNode(c);
  // Lobes follow the mirror direction: each node's are turned by the mirror's way from the node's elevation
  // to this one.
  const float c0 = kNodes.cos[node] * c + kNodes.sin[node] * s,
              s0 = kNodes.sin[node] * c - kNodes.cos[node] * s;
  const float c1 = kNodes.cos[node + 1] * c + kNodes.sin[node + 1] * s;
  const float s1 = kNodes.sin[node + 1] * c - kNodes.cos[node + 1] * s;
  const float w0 = 1 - t, w1 = t;
  const float wc0 = w0 * c0, ws0 = w0 * s0, wc1 = w1 * c1, ws1 = w1 * s1;
  const BrdfSlice &a = shape.slices[node], &b = shape.slices[node + 1];
  BrdfSlice out;
  out.lobes = shape.lobes;
  for (int k = 0; k < shape.lobes; ++k) {
    const BrdfLobe &p = a.lobe[k], &q = b.lobe[k];
    BrdfLobe& lobe = out.lobe[k];
    const float x = (wc0 * p.mu_x + ws0 * p.mu_z) + (wc1 * q.mu_x + ws1 * q.mu_z);
    const float z = (wc0 * p.mu_z - ws0 * p.mu_x) + (wc1 * q.mu_z - ws1 * q.mu_x);
    // Fitted lobes of neighbouring slices are never opposite; made ones that are must not divide by zero.
    const float inverse = 1 / std::sqrt(std::max(x * x + z * z, 1e-20f));
    lobe.mu_x = x * inverse;
    lobe.mu_z = z * inverse;
    lobe.kappa = w0 * p.kappa + w1 * q.kappa;
    lobe.scale = w0 * p.scale + w1 * q.scale;
    lobe.bias = w0 * p.bias + w1 * q.bias;
    lobe.above = w0 * p.above + w1 * q.above;
  }
  return out;
}

glm::vec3 DiffuseAlbedo(const Brdf& brdf, float cos_o) {
  if (brdf.model != BrdfModel::kGgx) return brdf.diffuse;
  const auto [node, t] = FindNode(std::clamp(cos_o, kMinCosine, 1.0f));
  const auto& table = TransmissionTable();
  return brdf.diffuse * (glm::vec3(1) - brdf.specular) * ((1 - t) * table[node] + t * table[node + 1]);
}

glm::vec3 EvaluateLobes(const Brdf& brdf, const BrdfShape& shape, const glm::vec3& wo, const glm::vec3& wi) {
  if (!(wo.z > 0 && wi.z > 0)) return glm::vec3(0);
  return Evaluate(MakeLobeModel(brdf, shape, wo), wi).value;
}

float PdfLobes(const Brdf& brdf, const BrdfShape& shape, const glm::vec3& wo, const glm::vec3& wi) {
  if (!(wo.z > 0 && wi.z > 0)) return 0;
  return Evaluate(MakeLobeModel(brdf, shape, wo), wi).pdf;
}

BrdfSample SampleLobes(const Brdf& brdf, const BrdfShape& shape, const glm::vec3& wo, float u_lobe, float u,
                       float v) {
  if (!(wo.z > 0)) return {};
  const LobeModel m = MakeLobeModel(brdf, shape, wo);
  int chosen = 0;
  for (; chosen < m.slice.lobes && u_lobe >= m.share[chosen]; ++chosen) u_lobe -= m.share[chosen];
  const float radius = std::sqrt(u), phi = 2 * kPi * v;
  const glm::vec3 wi = chosen < m.slice.lobes ? SampleVmf(m.vmf[chosen], u, v)
                                              : glm::vec3(radius * std::cos(phi), radius * std::sin(phi),
                                                          std::sqrt(std::max(0.0f, 1 - u)));
  if (!(wi.z > 0)) return {};
  const ModelValue at = Evaluate(m, wi);
  if (!(at.pdf > 0)) return {};
  return {wi, at.value / at.pdf, at.pdf};
}

}  // namespace glint
