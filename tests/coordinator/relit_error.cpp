#include "tests/coordinator/relit_error.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "common/render/archive_renderer.h"
#include "common/render/prefilter.h"
#include "common/render/reference.h"

namespace glint {
namespace {

/// Mean over a picture's covered pixels and channels of (picture - truth)^2 / ((picture^2 + truth^2) / 2 +
/// epsilon^2), epsilon a tenth of the mean. The square is the product of the distances from both halves of
/// the truth, so that their noise adds nothing.
double RelativeSquare(const Picture& picture, const ReferenceResult& truth) {
  double sum = 0, mean = 0, count = 0;
  auto for_each = [&](const auto& body) {
    for (size_t p = 0; p < picture.pixels.size(); ++p)
      for (int c = 0; c < 3 && truth.picture.pixels[p].w == 1; ++c)
        body(static_cast<double>(picture.pixels[p][c]), static_cast<double>(truth.picture.pixels[p][c]),
             static_cast<double>(truth.half_difference.pixels[p][c]));
  };
  for_each([&](double, double t, double) { mean += t, count += 1; });
  const double epsilon = 0.1 * mean / count;
  for_each([&](double a, double t, double half) {
    sum += ((a - t) * (a - t) - half * half) / (0.5 * (a * a + t * t) + epsilon * epsilon);
  });
  return sum / count;
}

}  // namespace

View OrbitView(const std::vector<glm::vec3>& positions, int i, int size) {
  glm::vec3 low(positions[0]), high(positions[0]);
  for (const glm::vec3& p : positions) low = glm::min(low, p), high = glm::max(high, p);
  const float azimuth = glm::radians(20.0f + 45.0f * static_cast<float>(i));
  const float elevation = glm::radians(i % 2 == 0 ? 20.0f : 45.0f);
  View view;
  view.width = view.height = size;
  view.environment_rotation_deg = 135.0f * static_cast<float>(i);
  view.camera.vertical_fov = glm::radians(40.0f);
  view.camera.forward = -glm::vec3(std::cos(elevation) * std::cos(azimuth), std::sin(elevation),
                                   std::cos(elevation) * std::sin(azimuth));
  const float distance = 0.5f * glm::length(high - low) / std::sin(0.5f * view.camera.vertical_fov);
  view.camera.eye = 0.5f * (low + high) - view.camera.forward * distance;
  return view;
}

Result<double> RelitError(const Scene& scene, const Archive& archive, const Environment& environment,
                          const RelitOptions& options) {
  const PrefilteredEnvironment prefiltered(environment, options.threads);
  const RayScene rays(scene, options.threads);
  ArchiveRenderOptions render_options;
  render_options.samples = 16;
  render_options.threads = options.threads;
  ArchiveRenderer renderer(archive, prefiltered, render_options);
  ReferenceOptions reference;
  reference.lobes = true;
  reference.bounces = static_cast<int>(archive.layers().size()) - 1;
  reference.samples = options.samples;
  reference.threads = options.threads;
  double sum = 0;
  for (int i = 0; i < options.views; ++i) {
    const View view = OrbitView(scene.positions, i, options.size);
    GLINT_ASSIGN_OR_RETURN(const Picture picture, renderer.Render(view));
    GLINT_ASSIGN_OR_RETURN(const ReferenceResult truth,
                           RenderReference(scene, rays, &archive.domain(), environment, view, reference));
    sum += RelativeSquare(picture, truth);
  }
  return std::sqrt(std::max(0.0, sum / options.views));
}

}  // namespace glint
