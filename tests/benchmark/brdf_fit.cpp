// Prints how well vMF mixtures reproduce BRDF slices, and what a fit costs: one line a shape and number of
// lobes.

#include <cstdint>
#include <cstdio>
#include <ctime>
#include <initializer_list>

#include "common/lobes/brdf_table.h"

namespace glint {
namespace {

// Of this thread's processor: what else runs on the machine does not count.
double Seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void PrintShape(const char* name, BrdfModel model, float shape) {
  for (int lobes = 1; lobes <= kMaxBrdfLobes; ++lobes) {
    const double start = Seconds();
    const BrdfShape fit = FitBrdfShape(model, shape, {.max_lobes = lobes, .tolerance = 0});
    const double ms = 1e3 * (Seconds() - start);
    std::printf("%-6s %7g %5d %8.4f %8.4f %10.2e %8.4f %7.1f\n", name, shape, fit.lobes, fit.error.mean_l2,
                fit.error.max_l2, fit.error.max_albedo, fit.error.max_below_horizon, ms);
  }
}

// Nanoseconds of one look-up of a slice at unrelated elevations.
void PrintLookup() {
  const BrdfShape fit = FitBrdfShape(BrdfModel::kGgx, 0.25f, {.max_lobes = 3, .tolerance = 0});
  constexpr int kCount = 4 << 20;
  float sum = 0;
  const double start = Seconds();
  for (uint32_t i = 0; i < kCount; ++i)
    sum += LookupSlice(fit, static_cast<float>(i * 2654435761u >> 8) * 0x1p-24f).lobe[0].kappa;
  std::printf("look-up of %d lobes: %.1f ns (mean kappa %.0f)\n", fit.lobes,
              1e9 * (Seconds() - start) / kCount, sum / kCount);
}

}  // namespace
}  // namespace glint

int main() {
  using glint::BrdfModel;
  std::printf("model    shape lobes  mean L2   max L2 albedo err  below        ms\n");
  for (const float r : {0.1f, 0.15f, 0.2f, 0.25f, 0.35f, 0.5f, 1.0f})
    glint::PrintShape("GGX", BrdfModel::kGgx, r);
  for (const float n : {8.0f, 32.0f, 128.0f, 512.0f}) glint::PrintShape("Phong", BrdfModel::kPhong, n);
  for (const float n : {32.0f, 512.0f}) glint::PrintShape("Blinn", BrdfModel::kBlinnPhong, n);
  glint::PrintLookup();
  return 0;
}
