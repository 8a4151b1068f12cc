#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/domain/bake_domain.h"
#include "common/scene/ray_scene.h"
#include "coordinator/spatial/lobe_sight.h"
#include "coordinator/spatial/mask_directions.h"
#include "coordinator/spatial/vertex_hierarchy.h"

namespace glint {

/// What nodes see in a fixed set of directions, the same for all, and how wrong predictions of their slices
/// are by that. A view of a node is answered by what lies in its mirror direction, as blurred as the BRDF is,
/// and that of another node, which it is predicted from, by what that one sees in its own.
class VisibilityMasks {
 public:
  VisibilityMasks(const BakeDomain& domain, const RayScene& rays);

  /// To call when the domain has more nodes. Known masks stay.
  void Turn();
  /// Sees to it that these nodes' masks are known.
  void Look(std::span<const uint32_t> nodes, int threads);
  /// Nodes whose masks are known.
  uint64_t known() const { return known_count_; }
  /// Square of the relative error of a node's radiance if it is predicted from these, whose weights add up to
  /// 1: mean over views by their cosine. Views that nobody has from outside count less.
  double SquareError(uint32_t node, std::span<const Parent> prediction) const;
  /// The same of a node half-way between two, predicted from both, which sees what one of them does.
  double SquareErrorBetween(uint32_t a, uint32_t b) const;
  /// Nothing reaches the node: all that it sees are insides.
  bool Dark(uint32_t node) const { return masks_[node].dark; }

 private:
  static constexpr int kDirections = MaskDirections::kCount;
  using Sights = std::array<LobeSight, kDirections>;

  /// A LobeSight in 5 bytes.
  struct PackedSight {
    uint8_t open = 0, light = 0;
    std::array<int8_t, 3> onward{};
    static PackedSight Pack(const LobeSight& sight);
    LobeSight Unpack() const;
  };
  struct Mask {
    glm::vec3 normal{0};
    uint16_t shape = 0;
    bool double_sided = false;
    bool dark = true, free = true;                  ///< sees insides, or the outside, and nothing else
    float diffuse = 0;                              ///< part of the reflectance
    std::bitset<kDirections> above, outside;        ///< a horizon; directions that nothing blocks
    LobeSight hemisphere;                           ///< of the diffuse lobe
    std::array<PackedSight, kDirections> specular;  ///< of lobes about each direction above the horizon
  };
  /// Blur of a shape's lobe, and what errors it causes.
  struct Lobe {
    struct Weight {
      uint8_t direction;
      float weight;
    };
    std::vector<std::vector<Weight>> blur;  ///< of each direction
    SightError error;
  };

  Lobe MakeLobe(const BrdfShape& shape) const;
  Mask Trace(uint32_t node) const;
  LobeSight Seen(const Hit& hit, const glm::vec3& direction) const;
  void Blur(const Sights& seen, Mask* mask) const;
  /// What answers a view; false: nothing does.
  bool Answer(const Mask& mask, const glm::vec3& wo, LobeSight* sight) const;
  /// Mean of visit(wo, index of wo) over views from above a surface's horizon.
  template <class Visit>
  double MeanOverViews(const glm::vec3& normal, bool double_sided, const Visit& visit) const;

  const BakeDomain& domain_;
  const RayScene& rays_;
  const MaskDirections directions_;
  std::vector<Lobe> lobes_;  ///< of the domain's shapes
  const SightError diffuse_error_;
  std::vector<Mask> masks_;  ///< of each node
  std::vector<uint8_t> known_;
  uint64_t known_count_ = 0;
};

}  // namespace glint
