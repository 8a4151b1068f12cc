#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/archive/archive.h"
#include "common/base/status.h"
#include "common/domain/bake_domain.h"
#include "common/domain/bake_settings.h"
#include "common/domain/direction_grid.h"
#include "common/scene/ray_scene.h"

namespace glint {

/// Where an archive's answer goes wrong, in the order in which a chain of answers from the truth to the
/// archive's own lets the causes in (docs/error-estimate.md).
enum class ErrorCause : uint8_t {
  kLobes,    ///< a slice is read out as one or a few lobes for each lobe of the BRDF
  kBits,     ///< and stored in 6 to 12 bytes, or not at all where it changes little
  kAngular,  ///< for some view directions only
  kSpatial,  ///< at vertices only
  kBelow,    ///< it gathers the layer below as the archive has it, with that layer's errors
  kRays      ///< with the bake's rays
};
inline constexpr int kErrorCauses = 6;
inline constexpr std::array<const char*, kErrorCauses> kErrorCauseNames = {"lobes",   "bits",  "angular",
                                                                           "spatial", "below", "rays"};

/// Raised whenever a change makes other estimates of the same archive: part of an archive's key.
inline constexpr int kEstimateRevision = 2;

inline constexpr int kMaxEstimateSlices = 1 << 20;

struct EstimateOptions {
  uint32_t slices = 0;  ///< to test, at most kMaxEstimateSlices
  uint64_t seed = 1;
  ReadOut read_out;  ///< the bake's
  int threads = 0;   ///< 0: all cores; the estimate does not depend on it
};

/// How many slices a bake tests by itself: a twentieth of its time or less, from some 1,500 vertices on.
uint32_t DefaultEstimateSlices(uint32_t vertices);

/// Relative errors of relit radiance, of one layer or of all, as parts of the light of all layers.
struct ErrorSummary {
  double rms = 0;                            ///< over slices: that of pictures
  double uncertainty = 0;                    ///< standard error of `rms`, upwards
  double p95 = 0, worst = 0;                 ///< of single slices, rms over their skies
  std::array<double, kErrorCauses> cause{};  ///< rms of what each cause changes
};

/// How far an archive's answers are from the truth for the same lobes of the BRDFs (docs/error-estimate.md).
struct ErrorEstimate {
  uint32_t slices = 0;  ///< tested
  ErrorSummary all;
  std::vector<ErrorSummary> layers;
};

/// Tests slices at random positions and directions. A function of the archive and the options alone.
/// kInterrupted once StopRequested().
Result<ErrorEstimate> EstimateError(const BakeDomain& domain, const RayScene& rays, const DirectionGrid& grid,
                                    std::span<const LayerViews> layers, const EstimateOptions& options);

/// The same as a JSON object: "slices", "all", and "layers" of the same form as "all".
std::string ToJson(const ErrorEstimate& estimate);

}  // namespace glint
