// Pictures per second of an archive, with the share of pixels that show a surface and the time per such
// pixel.
//
//   glint_benchmark_render ARCHIVE ENVIRONMENT [WIDTHxHEIGHT [SECONDS [THREADS]]]
//
// The view is the archive's first camera, or, without one, from the front of its bounding box; the
// environment turns by one degree a picture, as it would in a viewer.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <string>

#include "common/archive/archive.h"
#include "common/base/parallel.h"
#include "common/render/archive_renderer.h"

namespace {

using namespace glint;  // NOLINT: a program, not a header

using Clock = std::chrono::steady_clock;

double Since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

Camera FrontCamera(const BakeDomain& domain) {
  glm::vec3 low(1e30f), high(-1e30f);
  for (const glm::vec3& p : domain.positions) low = glm::min(low, p), high = glm::max(high, p);
  Camera camera;
  const glm::vec3 middle = 0.5f * (low + high);
  camera.eye = middle + glm::vec3(0.3f, 0.4f, 1.0f) * glm::length(high - low);
  camera.forward = middle - camera.eye;
  return camera;
}

struct Arguments {
  std::string archive, environment;
  int width = 1024, height = 768, threads = 0;
  double seconds = 10;
};

Status Measure(const Arguments& arguments) {
  auto start = Clock::now();
  GLINT_ASSIGN_OR_RETURN(const Archive archive, Archive::Open(arguments.archive));
  std::printf("open      %8.3f s  %u vertices, %zu layers\n", Since(start), archive.domain().vertex_count(),
              archive.layers().size());
  GLINT_ASSIGN_OR_RETURN(const Environment sky, Environment::Open(arguments.environment));
  start = Clock::now();
  const PrefilteredEnvironment prefiltered(sky, arguments.threads);
  std::printf("prefilter %8.3f s\n", Since(start));

  View view;
  view.camera = archive.cameras().empty() ? FrontCamera(archive.domain()) : archive.cameras().front();
  view.width = arguments.width;
  view.height = arguments.height;
  const int layers = static_cast<int>(archive.layers().size());
  for (int last = 0; last < layers; ++last) {
    ArchiveRenderOptions options;
    options.last_layer = last;
    options.threads = arguments.threads;
    ArchiveRenderer renderer(archive, prefiltered, options);
    int pictures = 0;
    double covered = 0;
    start = Clock::now();
    while (pictures == 0 || Since(start) < arguments.seconds / layers) {
      view.environment_rotation_deg = static_cast<float>(pictures++);
      GLINT_ASSIGN_OR_RETURN(const Picture picture, renderer.Render(view));
      if (pictures > 1) continue;
      for (const glm::vec4& p : picture.pixels) covered += p.w / static_cast<double>(picture.pixels.size());
    }
    const double seconds = Since(start) / pictures;
    const double pixels = covered * arguments.width * arguments.height;
    std::printf(
        "layers 0 to %d: %6.2f pictures/s of %dx%d on %d threads, %.0f%% covered, %.0f core-ns a covered "
        "pixel\n",
        last, 1 / seconds, arguments.width, arguments.height, ResolveThreadCount(arguments.threads),
        100 * covered, 1e9 * seconds * ResolveThreadCount(arguments.threads) / pixels);
  }
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: %s ARCHIVE ENVIRONMENT [WIDTHxHEIGHT [SECONDS [THREADS]]]\n", argv[0]);
    return static_cast<int>(glint::ErrorKind::kUsage);
  }
  Arguments arguments;
  arguments.archive = argv[1];
  arguments.environment = argv[2];
  if (argc > 3 && std::sscanf(argv[3], "%dx%d", &arguments.width, &arguments.height) != 2) {
    std::fprintf(stderr, "%s: the size must look like 1024x768\n", argv[3]);
    return static_cast<int>(glint::ErrorKind::kUsage);
  }
  if (argc > 4) arguments.seconds = std::atof(argv[4]);
  if (argc > 5) arguments.threads = std::atoi(argv[5]);
  const glint::Status status = Measure(arguments);
  if (!status.ok()) std::fprintf(stderr, "error: %s\n", status.message().c_str());
  return static_cast<int>(status.kind());
}
