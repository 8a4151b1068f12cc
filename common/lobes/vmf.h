#pragma once

#include <glm/vec3.hpp>

namespace glint {

/// Largest concentration that a lobe can hold; sharper ones are clamped (a mirror's width is then 0.06
/// degrees).
inline constexpr float kMaxKappa = 1.0e6f;

/// A von Mises-Fisher lobe. `mu` unit; kappa in [0, kMaxKappa].
struct Vmf {
  glm::vec3 mu{0, 0, 1};
  float kappa = 0;
};

/// delta = 1 - ||r|| of a lobe, ||r|| = coth(kappa) - 1/kappa its mean cosine: the form that keeps its digits
/// for sharp lobes (||r|| itself does not). kappa >= 0. Result in (0, 1]. Relative error <= 1e-6 in delta.
float DeltaFromKappa(float kappa);
/// The inverse; delta in [0, 1]; clamps to [0, kMaxKappa]. 1 / delta where that is exact, a polynomial
/// elsewhere. Relative error <= 1e-6 against the exact inverse of the float given. A float delta near 1
/// cannot carry a small kappa: the round trip is within 1e-6 relative down to kappa = 0.3 and 3e-7 absolute
/// below; use ||r|| there.
float KappaFromDelta(float delta);
/// Mean cosine of the lobe, in [0, 1).
float MeanCosineFromKappa(float kappa);
/// Concentration of the lobe with mean cosine r in [0, 1]; exact form both ways (a float r cannot tell kappa
/// > 1e5).
float KappaFromMeanCosine(float r);

/// Density at unit direction s, 1/sr: kappa / (2 pi (1 - e^(-2 kappa))) e^(kappa (mu.s - 1)).
float VmfPdf(const Vmf& lobe, const glm::vec3& s);
/// The density's factor before the exponential, 1/sr (1/(4 pi) at kappa = 0).
float VmfNormalization(float kappa);
/// Direction drawn from the lobe; u in (0, 1), v in [0, 1).
glm::vec3 SampleVmf(const Vmf& lobe, float u, float v);

/// ||w0 gamma0 - w1 gamma1||^2 over the sphere, 1/sr; exact for every kappa, stable for close lobes.
float VmfDistance2(float w0, const Vmf& l0, float w1, const Vmf& l1);
/// integral of gamma0 gamma1 over the sphere, 1/sr.
float VmfInnerProduct(const Vmf& l0, const Vmf& l1);

/// Zeroth and first moment of a mixture: sufficient statistics that merge by addition (laurijssen2011 Eq. 4,
/// 10). Sums are double and the float directions are taken as exactly unit (their length is corrected to
/// second order), so 1 - ||r|| keeps the width of lobes up to kMaxKappa.
struct VmfMoments {
  double weight = 0;           ///< sum w, w >= 0
  double x = 0, y = 0, z = 0;  ///< sum w ||r|| mu

  void Add(double w, const Vmf& lobe);
  /// A unit direction: a lobe without width.
  void AddDirection(double w, const glm::vec3& s) {
    weight += w;
    AddVector(w, s);
  }
  VmfMoments& operator+=(const VmfMoments& o);
  /// The lobe with these moments. Opposite lobes that cancel give kappa 0 and mu = +Z; empty gives the same.
  Vmf Lobe() const;

 private:
  void AddVector(double w, const glm::vec3& unit) {
    const double ux = unit.x, uy = unit.y, uz = unit.z;
    const double scaled = w * (1.5 - 0.5 * (ux * ux + uy * uy + uz * uz));
    x += scaled * ux;
    y += scaled * uy;
    z += scaled * uz;
  }
};

/// Lobe from mean direction vector m (sum w r / sum w), |m| <= 1. Zero m: kappa 0.
Vmf LobeFromMean(const glm::vec3& m);

}  // namespace glint
