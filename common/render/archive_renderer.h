#pragma once

#include <memory>
#include <span>

#include "common/archive/archive.h"
#include "common/archive/transfer.h"
#include "common/render/prefilter.h"
#include "common/render/view.h"
#include "common/scene/ray_scene.h"

namespace glint {

struct ArchiveRenderOptions {
  int first_layer = 0, last_layer = 1 << 20;  ///< inclusive; clamped to what the archive has
  int samples = 1;                            ///< primary rays per pixel (stratified), 1 to 4096
  int threads = 0;
};

/// Relights an archive: Embree primary rays, interpolated slices, prefiltered environment. Building one
/// builds the ray scene; pictures of many views then cost only themselves. The archive and the environment
/// must outlive it.
class ArchiveRenderer : public Renderer {
 public:
  ArchiveRenderer(const Archive& archive, const PrefilteredEnvironment& environment,
                  const ArchiveRenderOptions& options);
  /// The same from an archive's parts.
  ArchiveRenderer(const BakeDomain& domain, DirectionGrid grid, std::span<const LayerViews> layers,
                  const PrefilteredEnvironment& environment, const ArchiveRenderOptions& options);
  ~ArchiveRenderer() override;
  /// Errors: kUsage for a view that CheckView refuses or a number of samples out of range, kInterrupted.
  Result<Picture> Render(const View& view) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace glint
