#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/transfer.h"
#include "common/domain/bake_domain.h"
#include "common/domain/direction_grid.h"
#include "common/lobes/lobe_sky.h"
#include "common/scene/ray_scene.h"
#include "coordinator/error_estimate.h"
#include "coordinator/probe_tables.h"
#include "coordinator/sky_light.h"
#include "worker/path_fan.h"

namespace glint {

/// A slice to test: anywhere on the surface, seen from anywhere, under skies of its own.
struct TestSlice {
  uint32_t index = 0;   ///< decides its random numbers
  TransferPoint point;  ///< as the archive sees it
  std::vector<LobeSky> skies;
};

/// Squares of differences between answers for a slice, relative: means over its skies and the channels of
/// difference^2 / ((archive^2 + truth^2) / 2 + epsilon^2), below the line the light of all layers together
/// whatever the difference is of. Each square is a product of two differences with independent noise, so that
/// noise adds next to nothing to its mean; it may be negative.
struct SliceError {
  using Causes = std::array<double, kErrorCauses>;
  double all = 0;                    ///< of all layers together
  std::vector<double> layer;         ///< of each layer alone
  Causes all_causes{};               ///< of all layers together
  std::vector<Causes> layer_causes;  ///< [layer]; empty if causes were not looked for
};

/// Tests an archive's answers for single slices by following many rays. Thread-safe.
class SliceTester {
 public:
  /// @param read_out  the bake's
  SliceTester(const BakeDomain& domain, const RayScene& rays, const DirectionGrid& grid,
              std::span<const LayerViews> layers, uint64_t seed, const ReadOut& read_out);

  /// Slice `index`: uniform over the surface, both sides of what has two, and cosine-weighted over directions
  /// above the face. False where nothing is reflected.
  bool Draw(uint32_t index, TestSlice* slice) const;
  /// What the archive answers, all layers together.
  SkyLight Predict(const TestSlice& slice) const;
  /// @param epsilon  radiance below which errors count as absolute
  /// @param causes   looks for the causes as well, which is most of the work
  SliceError Test(const TestSlice& slice, double epsilon, bool causes) const;

 private:
  struct Answers;

  bool DrawPoint(CounterRng* rng, TransferPoint* point) const;
  bool SeenFromOutside(const TransferPoint& point) const;
  SlicePoint PointOf(const TransferPoint& point) const;

  void AskOwn(const TestSlice& slice, int half, bool causes, Answers* answers) const;
  void AskDirections(const TestSlice& slice, int half, Answers* answers) const;
  void AskVertices(const TestSlice& slice, int half, Answers* answers) const;
  void AskArchive(const TestSlice& slice, int half, Answers* answers) const;
  struct Row;
  struct RowSlice;
  std::vector<RowSlice> SlicesOf(const Row& row) const;
  ProbeTables TablesAround() const;
  void GatherRow(const TestSlice& slice, const Row& row, int half, ProbeTables* paths,
                 ProbeTables* below) const;
  std::vector<FanLight> LightFromBelow(const PathFan& fan) const;
  void Read(const ProbeTables& tables, const TransferPoint& point, const TestSlice& slice,
            std::vector<SkyLight>* light) const;
  SliceError Compare(const Answers& answers, double epsilon, bool causes) const;

  int layers() const { return static_cast<int>(layers_.size()); }

  const BakeDomain& domain_;
  const RayScene& rays_;
  const DirectionGrid& grid_;
  const std::span<const LayerViews> layers_;
  const uint64_t seed_;
  const ReadOut read_out_;
  const std::vector<uint8_t> every_layer_;  ///< for each layer a 1
  const TransferReader reader_;
  const PathFanTracer tracer_;
  std::vector<double> area_up_to_;  ///< sum of the areas of triangles 0 .. i, twice where both sides reflect
};

}  // namespace glint
