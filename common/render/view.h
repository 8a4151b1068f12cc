#pragma once

#include <optional>
#include <string>

#include "common/base/status.h"
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

/// Whether a picture can be made of the view: 1 to 32768 pixels a side and at most 2^28 in all; a field of
/// view in (0, pi); a finite turn of the environment; an eye within kMaxEye, and finite directions. kUsage
/// naming the remedy. Renderers ask this first.
Status CheckView(const View& view);

/// `v` made unit, whatever its length; no value where it has no direction: it is zero or not finite.
std::optional<glm::vec3> UnitDirection(const glm::vec3& v);

/// Generates primary rays of a view that CheckView accepts.
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
