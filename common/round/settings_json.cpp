#include "common/round/settings_json.h"

#include <cstdint>
#include <limits>
#include <type_traits>

#include "common/domain/direction_grid.h"
#include "common/domain/facet_tree.h"
#include "common/round/json_field.h"

namespace glint {
namespace {

constexpr int kMaxRays = 1 << 20;
static_assert(sizeof(BakeSettings) == 88 && sizeof(BrdfFitOptions) == 8,
              "a field was added or taken away: do the same below");

/// Calls visit(name, field, low, high) for every number of the settings.
template <class Settings, class Visit>
void VisitNumbers(Settings& s, const Visit& visit) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  visit("grid_level", s.grid_level, 0, DirectionGrid::kMaxLevel);
  visit("angular_tolerance", s.angular_tolerance, 0.0f, kLargest);
  visit("base_level", s.base_level, 0, DirectionGrid::kMaxLevel);
  visit("rays_per_kappa", s.rays_per_kappa, 0.0f, kLargest);
  visit("min_rays", s.min_rays, 1, kMaxRays);
  visit("max_rays", s.max_rays, 1, kMaxRays);
  visit("split_levels", s.split_levels, 0, 2);
  visit("own_rays", s.own_rays, 0, kMaxOwnRays);
  visit("paper_rays", s.paper_rays, 1, kMaxRays);
  visit("drop", s.drop, 0.0f, 1.0f);
  visit("bits_tolerance", s.bits_tolerance, 0.0f, 1.0f);
  visit("slice_lobes", s.slice_lobes, 1, kMaxSliceLobes);
  visit("lobe_tolerance", s.lobe_tolerance, 0.0f, 1.0f);
  visit("seed", s.seed, uint64_t{0}, std::numeric_limits<uint64_t>::max());
  visit("fit_max_lobes", s.fit.max_lobes, 1, kMaxBrdfLobes);
  visit("fit_tolerance", s.fit.tolerance, 0.0f, 1.0f);
  visit("spatial_tolerance", s.spatial_tolerance, 0.0f, 1.0f);
  visit("smallest_edge", s.smallest_edge, 0.0f, 1.0f);
  visit("max_vertices", s.max_vertices, uint32_t{0}, FacetTree::kMaxNodes);
  visit("subdivide", s.subdivide, 0, FacetTree::kMaxDepth);
}

}  // namespace

nlohmann::ordered_json SettingsToJson(const BakeSettings& settings) {
  nlohmann::ordered_json json;
  json["method"] = settings.method == GatherMethod::kShared ? "shared" : "paper";
  VisitNumbers(settings, [&](const char* name, const auto& field, auto, auto) { json[name] = field; });
  return json;
}

Result<BakeSettings> SettingsFromJson(const nlohmann::ordered_json& json) {
  if (!json.is_object()) return BadInput("settings are not a JSON object");
  BakeSettings settings;
  const auto method = json.find("method");
  if (method == json.end() || (*method != "shared" && *method != "paper"))
    return BadInput("field 'method' is neither \"shared\" nor \"paper\"");
  settings.method = *method == "shared" ? GatherMethod::kShared : GatherMethod::kPaper;
  Status first_error;
  VisitNumbers(settings, [&](const char* name, auto& field, auto low, auto high) {
    using Field = std::remove_reference_t<decltype(field)>;
    Status read = ReadNumber<Field>(json, name, low, high, &field);
    if (first_error.ok()) first_error = std::move(read);
  });
  GLINT_RETURN_IF_ERROR(first_error);
  return settings;
}

}  // namespace glint
