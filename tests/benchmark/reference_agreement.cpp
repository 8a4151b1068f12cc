// Prints how well the path-traced reference agrees with outside path tracers: an exact one, and Cycles, which
// differs by its Fresnel curve. relMSE is of 4 x 4 pixel blocks inside the mask; "excess" is what is left of
// it when the noise of both pictures is taken away, and its square root is the relative difference that noise
// does not explain.
//
//   reference_agreement [SAMPLES [SCENE...]]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "common/scene/load.h"
#include "tests/render/outside_references.h"

namespace {

using namespace glint;  // NOLINT: a program, not a header

double Seconds(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void PrintExact(const std::string& name, const OutsidePicture& picture, const Agreement& agreement,
                double seconds) {
  const double excess = agreement.rel_mse - agreement.noise - picture.noise_block4_rel_mse;
  std::printf("%-14s exact   b%-3d %9.3e %9.3e %9.3e %10.3e %8.3f%% %8s %7.1f\n", name.c_str(),
              picture.bounces, agreement.rel_mse, agreement.noise, picture.noise_block4_rel_mse, excess,
              100 * agreement.bias, "0", seconds);
}

Status PrintView(const std::string& name, const OutsideView& outside, int samples) {
  GLINT_ASSIGN_OR_RETURN(const Scene scene, LoadScene(outside.scene));
  GLINT_ASSIGN_OR_RETURN(const Environment sky, Environment::Load(outside.environment));
  const RayScene rays(scene);
  View view;
  view.camera = outside.camera;
  view.width = outside.width;
  view.height = outside.height;
  for (const OutsidePicture& picture : outside.pictures) {
    ReferenceOptions options;
    options.bounces = picture.bounces;
    options.samples = samples;
    const auto start = std::chrono::steady_clock::now();
    GLINT_ASSIGN_OR_RETURN(const ReferenceResult result,
                           RenderReference(scene, rays, nullptr, sky, view, options));
    const double seconds = Seconds(start);
    if (const char* folder = std::getenv("GLINT_PICTURES")) {
      const std::string file = name + "_b" + std::to_string(picture.bounces);
      GLINT_RETURN_IF_ERROR(WritePicture(result.picture, std::filesystem::path(folder) / (file + ".exr")));
      GLINT_RETURN_IF_ERROR(WritePicture(result.picture, std::filesystem::path(folder) / (file + ".png")));
    }
    GLINT_ASSIGN_OR_RETURN(const Agreement exact, CompareWithOutside(result, picture.file, outside.mask));
    PrintExact(name, picture, exact, seconds);
    if (picture.cycles_file.empty()) continue;
    GLINT_ASSIGN_OR_RETURN(const Agreement cycles,
                           CompareWithOutside(result, picture.cycles_file, outside.mask));
    std::printf("%-14s Cycles  b%-3d %9.3e %9.3e %9s %10s %8.3f%% %7.3f%%\n", name.c_str(), picture.bounces,
                cycles.rel_mse, cycles.noise, "-", "-", 100 * cycles.bias, 100 * picture.cycles_fresnel_bias);
  }
  return {};
}

Status Run(int samples, const std::vector<std::string>& scenes) {
  const auto data = FindSharedData();
  if (!data) {
    std::printf("No outside references: set GLINT_SHARED_DATA to the folder that holds ref/ and scenes/.\n");
    return {};
  }
  std::printf("%-14s %-12s %9s %9s %9s %10s %9s %8s %7s\n", "scene", "against", "relMSE", "noise",
              "its noise", "excess", "bias", "expected", "s");
  for (const std::string& name : scenes) {
    GLINT_ASSIGN_OR_RETURN(const std::vector<OutsideView> views, LoadOutsideViews(*data, name));
    for (const OutsideView& view : views) GLINT_RETURN_IF_ERROR(PrintView(name, view, samples));
  }
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  const int samples = argc > 1 ? std::atoi(argv[1]) : 64;
  std::vector<std::string> scenes(argv + std::min(argc, 2), argv + argc);
  if (scenes.empty()) scenes = {"teapot_plane", "goblets"};
  const glint::Status status = Run(samples, scenes);
  if (!status.ok()) std::fprintf(stderr, "error: %s\n", status.message().c_str());
  return static_cast<int>(status.kind());
}
