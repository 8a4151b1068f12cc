#pragma once

#include <memory>

#include "common/archive/archive.h"
#include "common/archive/transfer.h"
#include "common/render/prefilter.h"
#include "common/render/view.h"
#include "common/scene/ray_scene.h"

namespace glint {

struct ArchiveRenderOptions {
  int first_layer = 0, last_layer = 1 << 20;  ///< inclusive; clamped to what the archive has
  int samples = 1;                            ///< primary rays per pixel (stratified)
  int threads = 0;
};

/// Relights an archive: Embree primary rays, interpolated slices, prefiltered environment.
class ArchiveRenderer : public Renderer {
 public:
  ArchiveRenderer(const Archive& archive, const PrefilteredEnvironment& environment,
                  const ArchiveRenderOptions& options);
  ~ArchiveRenderer() override;
  Result<Picture> Render(const View& view) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace glint
