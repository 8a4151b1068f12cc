#pragma once

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "common/render/environment.h"

namespace glint {

/// Light of a block of texels as cosine-weighted averages see it while the block is above the horizon.
struct IrradianceMoment {
  glm::vec3 channel[3] = {glm::vec3(0), glm::vec3(0),
                          glm::vec3(0)};  ///< sum of radiance x sr / pi x direction

  /// Its part of the integral of L(s) max(0, n.s) / pi ds.
  glm::vec3 Average(const glm::vec3& n) const {
    return {std::max(0.0f, glm::dot(n, channel[0])), std::max(0.0f, glm::dot(n, channel[1])),
            std::max(0.0f, glm::dot(n, channel[2]))};
  }
};

/// Cosine-weighted averages of an environment for any normal, exact up to rounding and to where the horizon
/// runs within a leaf of a few texels: a block of texels that lies wholly above the horizon counts by its
/// first moment alone, since the cosine is linear there, and a block below not at all; only blocks on the
/// horizon are opened. The few blocks that hold a sun are kept apart: the sum over the others is smooth
/// enough to be tabulated.
class IrradianceTree {
 public:
  explicit IrradianceTree(const Environment& environment);

  /// integral of L(s) max(0, n.s) / pi ds without the bright blocks; n unit.
  glm::vec3 DimAverage(const glm::vec3& n) const;
  /// Blocks of 4 x 4 texels that each hold at least 1/1000 of all light; at most 8, the brightest first.
  const std::vector<IrradianceMoment>& bright() const { return bright_; }

 private:
  struct Node {
    IrradianceMoment moment;
    glm::vec3 center{0};  ///< of the cone around the block, unit
    float sine = 2;       ///< of the cone's half angle; above 1 if that is no use
    int second = 0;       ///< index of the second child; the first follows its parent. 0: a leaf
  };
  struct Texels;

  void SetBrightApart(Texels& texels);
  int Build(const Texels& texels, int x0, int x1, int y0, int y1);

  std::vector<Node> nodes_;
  std::vector<IrradianceMoment> bright_;
};

}  // namespace glint
