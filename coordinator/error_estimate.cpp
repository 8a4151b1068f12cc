#include "coordinator/error_estimate.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <utility>

#include "common/base/log.h"
#include "common/base/parallel.h"
#include "coordinator/slice_error.h"

namespace glint {
namespace {

constexpr double kEpsilon = 0.1;         ///< of the mean radiance, as `glint compare` has it
constexpr double kLeastEpsilon = 1e-20;  ///< for archives that answer black everywhere
constexpr size_t kCauseEvery = 4;        ///< slices; looking for causes is dear

using Json = nlohmann::ordered_json;

double Root(double square) { return std::sqrt(std::max(square, 0.0)); }

using Slices = std::vector<std::optional<TestSlice>>;

Slices DrawSlices(const SliceTester& tester, uint32_t count, int threads) {
  Slices slices(count);
  ParallelFor(count, threads, 16, [&](size_t i, int) {
    TestSlice slice;
    if (tester.Draw(static_cast<uint32_t>(i), &slice)) slices[i] = std::move(slice);
  });
  return slices;
}

/// Radiance below which errors count as absolute.
double Epsilon(const SliceTester& tester, const Slices& slices, int threads) {
  std::vector<double> light(slices.size(), 0);
  ParallelFor(slices.size(), threads, 16, [&](size_t i, int) {
    if (!slices[i]) return;
    for (const glm::vec3& l : tester.Predict(*slices[i]))
      light[i] += (l.x + l.y + l.z) / (3 * kSkiesPerSlice);
  });
  const double sum = std::accumulate(light.begin(), light.end(), 0.0);
  return std::max(kEpsilon * sum / static_cast<double>(std::max<size_t>(slices.size(), 1)), kLeastEpsilon);
}

/// @param square  of slices' errors, not empty
ErrorSummary Summarize(std::vector<double> square) {
  ErrorSummary summary;
  const auto count = static_cast<double>(square.size());
  const double mean = std::accumulate(square.begin(), square.end(), 0.0) / count;
  double variance = 0;
  for (const double e : square) variance += (e - mean) * (e - mean) / (count * count);
  summary.rms = Root(mean);
  summary.uncertainty = Root(mean + std::sqrt(variance)) - summary.rms;
  std::sort(square.begin(), square.end());
  summary.p95 = Root(square[static_cast<size_t>(std::lround(0.95 * (count - 1)))]);
  summary.worst = Root(square.back());
  return summary;
}

/// @param square  of a slice's error
/// @param causes  of it, by cause
template <class Square, class Causes>
ErrorSummary Summarize(const std::vector<SliceError>& errors, const Square& square, const Causes& causes) {
  std::vector<double> squares;
  SliceError::Causes sum{};
  double asked = 0;
  for (const SliceError& e : errors) {
    squares.push_back(square(e));
    if (e.layer_causes.empty()) continue;
    asked += 1;
    for (int c = 0; c < kErrorCauses; ++c) sum[c] += causes(e)[c];
  }
  ErrorSummary summary = Summarize(std::move(squares));
  for (int c = 0; c < kErrorCauses; ++c) summary.cause[c] = Root(sum[c] / std::max(asked, 1.0));
  return summary;
}

ErrorEstimate Summarize(const std::vector<SliceError>& errors, int layers) {
  ErrorEstimate estimate;
  estimate.slices = static_cast<uint32_t>(errors.size());
  estimate.layers.resize(layers);
  if (errors.empty()) return estimate;
  estimate.all = Summarize(
      errors, [](const SliceError& e) { return e.all; },
      [](const SliceError& e) -> const auto& { return e.all_causes; });
  for (int j = 0; j < layers; ++j)
    estimate.layers[j] = Summarize(
        errors, [j](const SliceError& e) { return e.layer[j]; },
        [j](const SliceError& e) -> const auto& { return e.layer_causes[j]; });
  return estimate;
}

Json ToJson(const ErrorSummary& summary) {
  Json causes = Json::object();
  for (int c = 0; c < kErrorCauses; ++c) causes[kErrorCauseNames[c]] = summary.cause[c];
  return {{"rms", summary.rms},
          {"uncertainty", summary.uncertainty},
          {"p95", summary.p95},
          {"worst", summary.worst},
          {"causes", causes}};
}

}  // namespace

uint32_t DefaultEstimateSlices(uint32_t vertices) { return std::clamp(vertices / 10, 64u, 2048u); }

std::string ToJson(const ErrorEstimate& estimate) {
  Json json = {{"slices", estimate.slices}, {"all", ToJson(estimate.all)}, {"layers", Json::array()}};
  for (const ErrorSummary& layer : estimate.layers) json["layers"].push_back(ToJson(layer));
  return json.dump();
}

Result<ErrorEstimate> EstimateError(const BakeDomain& domain, const RayScene& rays, const DirectionGrid& grid,
                                    std::span<const LayerViews> layers, const EstimateOptions& options) {
  if (layers.empty()) return ErrorEstimate{};
  const int threads = ResolveThreadCount(options.threads);
  const SliceTester tester(domain, rays, grid, layers, options.seed, options.read_out);
  const Slices slices = DrawSlices(tester, options.slices, threads);
  const double epsilon = Epsilon(tester, slices, threads);
  std::vector<SliceError> errors(slices.size());
  ParallelFor(slices.size(), threads, 1, [&](size_t i, int) {
    if (slices[i] && !StopRequested()) errors[i] = tester.Test(*slices[i], epsilon, i % kCauseEvery == 0);
  });
  if (StopRequested()) return Interrupted("stopped on request");
  std::erase_if(errors, [](const SliceError& e) { return e.layer.empty(); });
  return Summarize(errors, static_cast<int>(layers.size()));
}

}  // namespace glint
