#pragma once

#include <string>

#include "common/render/image.h"
#include "common/scene/scene.h"

namespace glint {

/// What a camera ray that misses the scene shows; its alpha is 0 either way.
enum class Background { kBlack, kEnvironment };

/// What a picture shows, the same for every renderer: pixel (x, y) covers camera rays through
/// ((x + dx) / W, (y + dy) / H), dx, dy in [0, 1), square pixels, vertical field of view.
struct View {
  Camera camera;
  int width = 512, height = 512;
  float environment_rotation_deg = 0;  ///< about +Y
  Background background = Background::kBlack;
};

/// Generates primary rays of a view.
class PrimaryRays {
 public:
  explicit PrimaryRays(const View& view);
  /// Unit direction through the picture position (x, y) in pixels (centres at +0.5).
  glm::vec3 Direction(float x, float y) const;
  const glm::vec3& eye() const { return eye_; }

 private:
  glm::vec3 eye_, forward_, right_, up_;
  float scale_x_, scale_y_, width_, height_;
};

/// Anything that turns a view into a picture: the archive, the path tracer, and the papers' other methods.
class Renderer {
 public:
  virtual ~Renderer() = default;
  virtual Result<Picture> Render(const View& view) = 0;
};

}  // namespace glint
