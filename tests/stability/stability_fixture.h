#pragma once

#include <glm/ext/vector_double3.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/transfer.h"
#include "common/domain/direction_grid.h"
#include "common/scene/mesh_builder.h"
#include "coordinator/bake.h"
#include "tests/base/temp_folder.h"

namespace glint::stability {

/// Prints one measurement, a line of its own that docs/stability.md quotes, and fails beyond the bound.
void ExpectAtMost(const std::string& what, double value, double bound);

/// A number in three digits or fewer, as the measurements' names have it.
std::string Short(double value);

std::string NameOf(GatherMethod method);

/// Reflects `albedo` the same from everywhere to everywhere.
Material Lambert(const glm::vec3& albedo);
/// Half of it glossy, half diffuse, so that both kinds of slices are at work.
Material Glossy(float exponent = 32);
Material Metal(float roughness, const glm::vec3& color = glm::vec3(1));

/// Scenes are looked at by the tests themselves; this stands where a camera must.
Camera AnyCamera();

/// The six sides of a box, each a patch with its own vertices, rows x rows of them.
/// @param inwards  fronts face the middle
void AddBox(const glm::dvec3& low, const glm::dvec3& high, int rows, bool inwards, uint16_t material,
            MeshBuilder* builder);

/// A floor of x in [0, 2], front up, and a wall of height 1 on its border x = 0, both so long in z that
/// nothing of their ends is seen from the floor's middle row of vertices (z = 0), which stand at these x.
Scene FloorByWall(const std::vector<double>& x, const Material& material);
/// What the wall leaves of the cosine-weighted hemisphere over the floor, at distance x.
double FreeBesideWall(double x);

/// How a small scene is baked.
struct SmallBake {
  GatherMethod method = GatherMethod::kShared;
  int layers = 0;       ///< indirect ones
  int grid_level = 1;   ///< 42 directions
  int rays = 1024;      ///< kShared: at least; kPaper: per slice, a quarter of it
  int max_rays = 4096;  ///< kShared: at most
};

/// A scene baked, checked and opened again.
class Baked {
 public:
  Baked(Scene scene, const SmallBake& options);

  const Scene& scene() const { return scene_; }
  const Archive& archive() const { return *archive_; }
  const BakeDomain& domain() const { return archive_->domain(); }
  const DirectionGrid& grid() const { return grid_; }
  const BakeReport& report() const { return report_; }
  int layers() const { return static_cast<int>(archive_->layers().size()); }

  /// Free part of the cosine-weighted hemisphere on a vertex's front side.
  double FreeDiffuse(uint32_t vertex) const;
  /// Free part of the BRDF's lobe k; 1 also where no slice is defined.
  double FreeSpecular(uint32_t vertex, uint32_t column, int k = 0) const;
  /// Whether a slice is defined: the direction is over the front side.
  bool Defined(uint32_t vertex, uint32_t column) const;
  /// Radiance towards wo under a sky of radiance 1, by one layer; by the reader of pictures.
  glm::vec3 Reflected(uint32_t triangle, float u, float v, const glm::vec3& wo, int layer) const;
  /// The same at a vertex, by the first triangle that has it.
  glm::vec3 ReflectedAt(uint32_t vertex, const glm::vec3& wo, int layer) const;
  /// Largest part of any front slice, diffuse or specular, that is free.
  double LargestFree() const;

 private:
  TempFolder folder_;
  Scene scene_;
  DirectionGrid grid_;
  BakeReport report_;
  std::optional<Archive> archive_;
  std::unique_ptr<TransferReader> reader_;
};

}  // namespace glint::stability
