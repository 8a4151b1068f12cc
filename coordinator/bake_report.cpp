#include "coordinator/bake_report.h"

#include <nlohmann/json.hpp>

namespace glint {
namespace {

using Json = nlohmann::ordered_json;

const char* ModelName(BrdfModel model) {
  switch (model) {
    case BrdfModel::kGgx:
      return "ggx";
    case BrdfModel::kPhong:
      return "phong";
    case BrdfModel::kBlinnPhong:
      return "blinn-phong";
  }
  return "unknown";
}

Json DescribeShape(const BrdfShape& shape) {
  return {{"model", ModelName(shape.model)},
          {"shape", shape.shape},
          {"lobes", shape.lobes},
          {"fit_mean_l2", shape.error.mean_l2},
          {"fit_max_l2", shape.error.max_l2},
          {"fit_max_albedo_error", shape.error.max_albedo},
          {"fit_max_below_horizon", shape.error.max_below_horizon}};
}

Json DescribeSettings(const BakeOptions& options) {
  const BakeSettings& s = options.settings;
  Json json = {{"gather", s.method == GatherMethod::kShared ? "shared" : "paper"},
               {"grid_level", s.grid_level}};
  if (s.method == GatherMethod::kShared) {
    json.update({{"angular_tolerance", s.angular_tolerance},
                 {"base_level", s.BaseLevel()},
                 {"rays_per_kappa", s.rays_per_kappa},
                 {"min_rays", s.min_rays},
                 {"max_rays", s.max_rays},
                 {"split_levels", s.split_levels},
                 {"own_rays", s.own_rays},
                 {"slice_lobes", s.slice_lobes},
                 {"lobe_tolerance", s.lobe_tolerance}});
  } else {
    json["paper_rays"] = s.paper_rays;
  }
  json.update({{"drop", s.drop},
               {"bits_tolerance", s.bits_tolerance},
               {"seed", s.seed},
               {"fit_max_lobes", s.fit.max_lobes},
               {"fit_tolerance", s.fit.tolerance},
               {"spatial_tolerance", s.spatial_tolerance},
               {"smallest_edge", s.smallest_edge},
               {"max_vertices", s.max_vertices},
               {"subdivide", s.subdivide},
               {"max_layers", options.max_layers},
               {"layer_tolerance", options.layer_tolerance}});
  return json;
}

Json DescribeRefinement(const RefinementReport& r) {
  return {{"levels", r.levels},
          {"tested", r.tested},
          {"middles", r.middles},
          {"degenerate_triangles", r.degenerate},
          {"non_manifold_triangles", r.non_manifold}};
}

/// Slices with exactly 1, 2, ... lobes.
Json SlicesByLobes(const LayerReport& layer) {
  Json counts = Json::array();
  for (size_t n = 0; n < layer.stored.size(); ++n)
    counts.push_back(layer.stored[n] - (n + 1 < layer.stored.size() ? layer.stored[n + 1] : 0));
  return counts;
}

/// Names of files and nodes may be in any encoding; no such name may make a finished bake fail.
std::string ToText(const Json& json) { return json.dump(1, '\t', false, Json::error_handler_t::replace); }

}  // namespace

std::string DeterministicReportJson(const BakeReport& report, const BakeDomain& domain,
                                    const BakeOptions& options) {
  Json json = {{"scene", report.scene},         {"vertices", report.vertices},
               {"triangles", report.triangles}, {"directions", report.directions},
               {"rays", report.rays},           {"execution", report.execution}};
  json["baked_vertices"] = report.baked_vertices;
  if (report.refinement) json["refinement"] = DescribeRefinement(*report.refinement);
  json["settings"] = DescribeSettings(options);
  for (const BrdfShape& shape : domain.shapes) json["brdfs"].push_back(DescribeShape(shape));
  for (const LayerReport& layer : report.layers)
    json["layers"].push_back({{"slices", layer.slices},
                              {"stored", layer.stored[0]},
                              {"absent", layer.slices - layer.stored[0]},
                              {"with_lobes", SlicesByLobes(layer)},
                              {"density", layer.density},
                              {"relative_light", layer.energy}});
  json["complete"] = report.complete;
  if (report.error) json["error"] = Json::parse(ToJson(*report.error));
  json["notes"] = report.notes;
  return ToText(json);
}

std::string FullReportJson(const BakeReport& report) {
  Json json = Json::parse(report.deterministic_json);
  json["archive_key"] = report.archive_key.Hex();
  json["seconds"] = report.seconds;
  Json& stages = json["seconds_by_stage"] = Json::object();
  for (const auto& [stage, seconds] : report.stage_seconds)
    stages[stage] = stages.value(stage, 0.0) + seconds;  // a layer that was mended ran twice
  json["tasks"] = report.tasks;
  json["tasks_reused"] = report.tasks_reused;
  json["archive_bytes"] = report.archive_bytes;
  return ToText(json) + "\n";
}

}  // namespace glint
