#include "common/render/archive_renderer.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "common/base/log.h"
#include "common/base/parallel.h"
#include "common/domain/bare_scene.h"

namespace glint {
namespace {

constexpr int kTile =
    8;  // pixels a side: a tile's rays are traced together and its look-ups share cache lines
constexpr int kMaxSamples = 4096;

/// The filtered environment, turned: directions in the world frame.
class TurnedEnvironment {
 public:
  TurnedEnvironment(const PrefilteredEnvironment& environment, float degrees)
      : environment_(environment), frame_(degrees) {}

  glm::vec3 Radiance(const glm::vec3& d) const { return environment_.Radiance(frame_.ToLookup(d)); }

  /// Light that one term of the transfer reflects at a point with shading normal `normal`.
  glm::vec3 Reflected(const TransferLobe& lobe, const glm::vec3& normal) const {
    const glm::vec3 filtered = environment_.Filtered(frame_.ToLookup(lobe.mu), lobe.kappa);
    if (!lobe.cosine) return lobe.alpha * filtered;
    const glm::vec3 n = frame_.ToLookup(normal);
    const glm::vec3 correction = environment_.CosineAverage(n) - environment_.Filtered(n, kCosineKappa);
    return lobe.alpha * glm::max(glm::vec3(0), correction + filtered);
  }

 private:
  const PrefilteredEnvironment& environment_;
  const LookupFrame frame_;
};

/// Position of sample `i` of `count` in the pixel: a Hammersley set moved to cell centres, so that one sample
/// is the pixel's centre.
glm::vec2 SamplePosition(int i, int count) {
  float inverse = 0, digit = 0.5f;
  for (int rest = i; rest > 0; rest /= 2, digit *= 0.5f) inverse += digit * static_cast<float>(rest % 2);
  int cells = 1;
  while (cells < count) cells *= 2;
  return {(static_cast<float>(i) + 0.5f) / static_cast<float>(count),
          inverse + 0.5f / static_cast<float>(cells)};
}

/// Buffers of one tile, kept per thread: nothing is allocated or cleared per pixel.
struct TileBuffers {
  std::array<Ray, kTile * kTile> ray;
  std::array<Hit, kTile * kTile> hit;
  TransferPoint point;
  LayerLobes lobes;
};

}  // namespace

struct ArchiveRenderer::Impl {
  Impl(const BakeDomain& domain, DirectionGrid directions, std::span<const LayerViews> all_layers,
       const PrefilteredEnvironment& prefiltered, const ArchiveRenderOptions& render_options)
      : rays(BareScene(domain), render_options.threads),
        grid(std::move(directions)),
        reader(domain, grid),
        layers(all_layers),
        environment(prefiltered),
        options(render_options) {
    first_layer = std::max(options.first_layer, 0);
    last_layer = std::min(options.last_layer, static_cast<int>(layers.size()) - 1);
  }

  void RenderTile(const PrimaryRays& primary, const View& view, const TurnedEnvironment& sky, int x0, int y0,
                  TileBuffers* buffers, Picture* picture) const {
    const int x1 = std::min(x0 + kTile, view.width), y1 = std::min(y0 + kTile, view.height);
    const float weight = 1.0f / static_cast<float>(options.samples);
    for (int s = 0; s < options.samples; ++s) {
      const glm::vec2 offset = SamplePosition(s, options.samples);
      int count = 0;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          Ray& ray = buffers->ray[count++];
          ray.origin = primary.eye();
          ray.direction =
              primary.Direction(static_cast<float>(x) + offset.x, static_cast<float>(y) + offset.y);
        }
      }
      rays.IntersectCoherent(buffers->ray.data(), buffers->hit.data(), count);
      int i = 0;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x, ++i) {
          picture->at(x, y) += weight * Shade(buffers->hit[i], buffers->ray[i].direction, view, sky, buffers);
        }
      }
    }
  }

  glm::vec4 Shade(const Hit& hit, const glm::vec3& direction, const View& view, const TurnedEnvironment& sky,
                  TileBuffers* buffers) const {
    if (!hit.hit()) {
      const bool shows_sky = view.background == Background::kEnvironment && first_layer == 0;
      return glm::vec4(shows_sky ? sky.Radiance(direction) : glm::vec3(0), 0);
    }
    TransferPoint& point = buffers->point;
    glm::vec3 radiance(0);
    if (reader.Prepare(hit.triangle, hit.u, hit.v, -direction, &point)) {
      for (int index = first_layer; index <= last_layer; ++index) {
        LayerLobes& lobes = buffers->lobes;
        reader.Read(point, layers[static_cast<size_t>(index)], index, &lobes);
        for (int k = 0; k < lobes.count; ++k) radiance += sky.Reflected(lobes.lobe[k], point.normal);
      }
    }
    return glm::vec4(radiance, 1);
  }

  RayScene rays;
  DirectionGrid grid;
  TransferReader reader;
  std::span<const LayerViews> layers;
  const PrefilteredEnvironment& environment;
  ArchiveRenderOptions options;
  int first_layer = 0, last_layer = -1;
};

ArchiveRenderer::ArchiveRenderer(const Archive& archive, const PrefilteredEnvironment& environment,
                                 const ArchiveRenderOptions& options)
    : ArchiveRenderer(archive.domain(), archive.MakeGrid(), archive.layers(), environment, options) {}

ArchiveRenderer::ArchiveRenderer(const BakeDomain& domain, DirectionGrid grid,
                                 std::span<const LayerViews> layers,
                                 const PrefilteredEnvironment& environment,
                                 const ArchiveRenderOptions& options)
    : impl_(std::make_unique<Impl>(domain, std::move(grid), layers, environment, options)) {}

ArchiveRenderer::~ArchiveRenderer() = default;

Result<Picture> ArchiveRenderer::Render(const View& view) {
  GLINT_RETURN_IF_ERROR(CheckView(view));
  if (impl_->options.samples < 1 || impl_->options.samples > kMaxSamples) {
    return UsageError("samples " + std::to_string(impl_->options.samples) + ": must be 1 to " +
                      std::to_string(kMaxSamples));
  }
  const PrimaryRays primary(view);
  const TurnedEnvironment sky(impl_->environment, view.environment_rotation_deg);
  Picture picture(view.width, view.height);
  const int threads = ResolveThreadCount(impl_->options.threads);
  std::vector<TileBuffers> buffers(static_cast<size_t>(threads));
  const size_t tiles_x = static_cast<size_t>((view.width + kTile - 1) / kTile);
  const size_t tiles_y = static_cast<size_t>((view.height + kTile - 1) / kTile);
  std::atomic<bool> stopped = false;
  ParallelFor(tiles_x * tiles_y, threads, tiles_x, [&](size_t tile, int thread) {
    if (StopRequested()) {
      stopped = true;
      return;
    }
    impl_->RenderTile(primary, view, sky, static_cast<int>(tile % tiles_x) * kTile,
                      static_cast<int>(tile / tiles_x) * kTile, &buffers[static_cast<size_t>(thread)],
                      &picture);
  });
  if (stopped) return Interrupted("the picture is not finished; run the same command again");
  return picture;
}

}  // namespace glint
