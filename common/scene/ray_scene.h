#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <string>

#include "common/base/status.h"
#include "common/scene/scene.h"

namespace glint {

/// Where a ray met the scene. `triangle` is kNone for a miss. Position = (1-u-v) p0 + u p1 + v p2.
struct Hit {
  uint32_t triangle = kNone;
  float u = 0, v = 0;  ///< barycentric, >= 0, u + v <= 1
  float t = 0;         ///< distance in units of the ray's direction
  bool hit() const { return triangle != kNone; }
};

struct Ray {
  glm::vec3 origin{0};
  float t_near = 0;
  glm::vec3 direction{0, 0, 1};
  float t_far = 3.0e38f;
};

/// The scene's triangles in an Embree BVH (robust mode). Immutable and safe to share between threads. Rays
/// hit both sides of a triangle; a direction need not be a unit vector. A ray aimed to the last bit at an
/// edge between coplanar triangles may slip through (Embree 3.13.5 with AVX2: about 3 in 10,000 of such rays;
/// none in 100,000 random ones).
class RayScene {
 public:
  /// Builds the tree. The order of primitives in it, and so which of two triangles a ray through their shared
  /// edge reports, can depend on the number of building threads; `build_threads` 0 therefore means one, the
  /// same tree everywhere. More threads are for those to whom that does not matter.
  RayScene(std::span<const glm::vec3> positions, std::span<const std::array<uint32_t, 3>> triangles,
           int build_threads = 0);
  explicit RayScene(const Scene& scene, int build_threads = 0)
      : RayScene(scene.positions, scene.triangles, build_threads) {}
  ~RayScene();
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) = delete;

  /// Not ok if the tree could not be built (memory); every ray then misses.
  const Status& status() const { return status_; }

  /// Closest hit in [t_near, t_far].
  Hit Intersect(const Ray& ray) const;
  /// True if anything lies in [t_near, t_far].
  bool Occluded(const Ray& ray) const;
  /// The same for `count` rays, in packets of eight whose rays go their own ways: for fans over a hemisphere
  /// and other rays that part soon. Rays of a packet may influence each other's rounding.
  void Intersect(const Ray* rays, Hit* hits, int count) const;
  /// The same for rays that stay together, such as a camera's or some thousand over a hemisphere: eight at a
  /// time as coherent packets.
  void IntersectCoherent(const Ray* rays, Hit* hits, int count) const;

  /// A distance that is surely above the rounding of positions here: offset rays' origins by it along the
  /// normal. 2^-19 of the largest coordinate plus 1e-5 of the diagonal of the scene's bounds, in the scene's
  /// unit; holds for scenes of any size, and away from the origin as far as single precision still resolves
  /// their shape.
  float epsilon() const { return epsilon_; }
  /// Library and instruction set in use, for task keys ("embree 3.13.5 avx2").
  static std::string EngineId();

 private:
  struct Impl;
  void IntersectPackets(const Ray* rays, Hit* hits, int count, int flags) const;

  std::unique_ptr<Impl> impl_;
  Status status_;
  float epsilon_ = 0;
  float to_unit_ = 1;  ///< Embree's lengths over the scene's
};

}  // namespace glint
