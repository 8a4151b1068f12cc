#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>

#include "common/archive/archive.h"
#include "common/base/files.h"
#include "common/base/log.h"
#include "common/domain/direction_grid.h"
#include "tools/commands.h"
#include "tools/report.h"

namespace glint {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint64_t kMaxReportBytes = 16 << 20;

/// The report with times that the bake leaves beside the archive; null if it is not there, or another's.
Json ReadReport(const std::string& path, const Archive& archive) {
  const std::string report_path = path + ".json";
  std::error_code error;
  if (!std::filesystem::exists(report_path, error)) return {};
  const auto bytes = ReadFile(report_path, kMaxReportBytes);
  if (!bytes.ok()) {
    Log(LogLevel::kNote, bytes.status().message() + "; it is not shown");
    return {};
  }
  Json report = ParseReport({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  const auto key = report.find("archive_key");
  if (key != report.end() && *key == archive.archive_key().Hex()) return report;
  Log(LogLevel::kNote, report_path + ": is not the report of this archive, so it is not shown");
  return {};
}

constexpr const char* kForms[] = {"classic", "compact", "segmented"};  ///< by TableForm

Json DescribeTable(const SliceTableView& table, const std::string& name) {
  return {{"name", name},
          {"form", kForms[static_cast<size_t>(table.form())]},
          {"rows", table.rows()},
          {"columns", table.columns()},
          {"entry_bytes", table.entry_bytes()},
          {"stored", table.entries()},
          {"density", table.density()},
          {"fill", table.fill()},
          {"entry_bytes", table.entry_bytes()},
          {"index_bytes", table.index_bytes()}};
}

/// What the bake's report says of a layer: slices there are, stored, absent, light. Empty unless it says all
/// of it in numbers.
Json LayerCounts(const Json& bake, size_t layer) {
  const auto layers = bake.find("layers");
  if (layers == bake.end() || !layers->is_array() || layer >= layers->size()) return Json::object();
  const Json& said = (*layers)[layer];
  Json counts = Json::object();
  for (const char* key : {"slices", "stored", "absent"}) {
    const auto count = said.find(key);
    if (count == said.end() || !count->is_number_unsigned()) return Json::object();
    counts[key] = *count;
  }
  for (const char* key : {"density", "relative_light"}) {
    const auto value = said.find(key);
    if (value == said.end() || !value->is_number()) return Json::object();
    counts[key] = *value;
  }
  return counts;
}

std::string TableName(const LayerViews& views, uint32_t lobe, uint32_t slot) {
  const std::string name =
      slot < views.diffuse_slot() ? "specular lobe " + std::to_string(slot) : std::string("diffuse");
  return lobe == 0 ? name : name + " +" + std::to_string(lobe);
}

/// Stored slices with exactly 1, 2, ... lobes.
Json SlicesByLobes(const LayerViews& views) {
  Json counts = Json::array();
  uint64_t more = 0;
  for (uint32_t lobe = views.lobes(); lobe-- > 0;) {
    uint64_t at_least = 0;
    for (uint32_t slot = 0; slot <= views.diffuse_slot(); ++slot)
      at_least += views.table(lobe, slot).entries();
    counts.insert(counts.begin(), at_least - std::min(more, at_least));
    more = at_least;
  }
  return counts;
}

Json DescribeLayers(const Archive& archive, const Json& bake) {
  Json layers = Json::array();
  for (size_t i = 0; i < archive.layers().size(); ++i) {
    const LayerViews& views = archive.layers()[i];
    Json tables = Json::array();
    for (uint32_t lobe = 0; lobe < views.lobes(); ++lobe)
      for (uint32_t slot = 0; slot <= views.diffuse_slot(); ++slot)
        tables.push_back(DescribeTable(views.table(lobe, slot), TableName(views, lobe, slot)));
    Json layer = {{"layer", i}};
    layer.update(LayerCounts(bake, i));
    layer["with_lobes"] = SlicesByLobes(views);
    layer["tables"] = tables;
    layers.push_back(layer);
  }
  return layers;
}

Json DescribeShapes(const BakeDomain& domain) {
  static constexpr const char* kModels[] = {"ggx", "phong", "blinn-phong"};
  Json shapes = Json::array();
  for (const BrdfShape& shape : domain.shapes) {
    shapes.push_back({{"model", kModels[static_cast<int>(shape.model)]},
                      {"shape", shape.shape},
                      {"lobes", shape.lobes},
                      {"fit_mean_l2", shape.error.mean_l2},
                      {"fit_max_l2", shape.error.max_l2},
                      {"fit_max_albedo_error", shape.error.max_albedo}});
  }
  return shapes;
}

Json DescribeArchive(const std::string& path, const Archive& archive) {
  const Json bake = ParseReport(archive.report_json());
  Json sections = Json::array(), cameras = Json::array();
  for (const SectionInfo& s : archive.sections()) {
    sections.push_back({{"name", s.name},
                        {"offset", s.offset},
                        {"stored_bytes", s.stored_bytes},
                        {"raw_bytes", s.raw_bytes}});
  }
  for (const Camera& camera : archive.cameras()) cameras.push_back(camera.name);
  return {{"archive", path},
          {"file_bytes", archive.file_bytes()},
          {"archive_key", archive.archive_key().Hex()},
          {"vertices", archive.domain().vertex_count()},
          {"baked_vertices", archive.domain().row_count()},
          {"triangles", archive.domain().triangles.size()},
          {"directions", archive.MakeGrid().size()},
          {"cameras", cameras},
          {"layers", DescribeLayers(archive, bake)},
          {"shapes", DescribeShapes(archive.domain())},
          {"sections", sections},
          {"bake", bake},
          {"report", ReadReport(path, archive)}};
}

/// Adds a line of printf's making to `out`.
template <class... Args>
void Line(std::string& out, const char* format, Args... args) {
  char line[256];
  std::snprintf(line, sizeof line, format, args...);
  out += line;
  out += '\n';
}

/// In one line. A name in another encoding than UTF-8 must not make it fail.
std::string Dump(const Json& value) { return value.dump(-1, ' ', false, Json::error_handler_t::replace); }

/// Nested objects as indented lines "key  value"; arrays stay on one line.
void PrintTree(std::string& out, const Json& object, int indent) {
  for (const auto& [key, value] : object.items()) {
    const std::string start = std::string(static_cast<size_t>(indent), ' ') + key;
    if (value.is_object()) {
      out += start + '\n';
      PrintTree(out, value, indent + 2);
    } else {
      out += start + std::string(start.size() < 28 ? 28 - start.size() : 1, ' ') + Dump(value) + '\n';
    }
  }
}

std::string ToText(const Json& d) {
  using Count = unsigned long long;
  std::string out;
  out += d["archive"].get<std::string>() + ": " + std::to_string(d["file_bytes"].get<Count>()) + " bytes\n";
  Line(out, "key         %s", d["archive_key"].get<std::string>().c_str());
  Line(out, "vertices    %llu", d["vertices"].get<Count>());
  Line(out, "baked       %llu", d["baked_vertices"].get<Count>());
  Line(out, "triangles   %llu", d["triangles"].get<Count>());
  Line(out, "directions  %llu", d["directions"].get<Count>());
  out += "cameras     " + Dump(d["cameras"]) + '\n';
  Line(out, "\n%-6s %12s %12s %12s %14s", "layer", "slices", "stored", "absent", "relative light");
  for (const Json& layer : d["layers"])
    if (layer.contains("slices"))
      Line(out, "%-6d %12llu %12llu %12llu %14.5f", layer["layer"].get<int>(), layer["slices"].get<Count>(),
           layer["stored"].get<Count>(), layer["absent"].get<Count>(), layer["relative_light"].get<double>());
  out += "\nstored slices with 1, 2, ... lobes for one of their BRDF's\n";
  for (const Json& layer : d["layers"])
    Line(out, "%-6d %s", layer["layer"].get<int>(), Dump(layer["with_lobes"]).c_str());
  const std::string error = ErrorTable(d["bake"].is_object() ? d["bake"].value("error", Json()) : Json());
  if (!error.empty()) out += '\n' + error;
  Line(out, "\n%-6s %-18s %-8s %10s %8s %12s %8s %7s %12s", "layer", "table", "form", "rows", "columns",
       "stored", "density", "fill", "index bytes");
  for (const Json& layer : d["layers"]) {
    for (const Json& t : layer["tables"]) {
      Line(out, "%-6d %-18s %-8s %10llu %8llu %12llu %8.4f %7.4f %12llu", layer["layer"].get<int>(),
           t["name"].get<std::string>().c_str(), t["form"].get<std::string>().c_str(), t["rows"].get<Count>(),
           t["columns"].get<Count>(), t["stored"].get<Count>(), t["density"].get<double>(),
           t["fill"].get<double>(), t["index_bytes"].get<Count>());
    }
  }
  Line(out, "\n%-12s %10s %6s %12s %12s %14s", "BRDF", "shape", "lobes", "mean L2", "max L2", "albedo error");
  for (const Json& s : d["shapes"]) {
    Line(out, "%-12s %10.4g %6d %12.4f %12.4f %14.2e", s["model"].get<std::string>().c_str(),
         s["shape"].get<double>(), s["lobes"].get<int>(), s["fit_mean_l2"].get<double>(),
         s["fit_max_l2"].get<double>(), s["fit_max_albedo_error"].get<double>());
  }
  Line(out, "\n%-28s %14s %14s", "section", "stored bytes", "raw bytes");
  for (const Json& s : d["sections"]) {
    Line(out, "%-28s %14llu %14llu", s["name"].get<std::string>().c_str(), s["stored_bytes"].get<Count>(),
         s["raw_bytes"].get<Count>());
  }
  Json report = d["report"].is_object() ? d["report"] : d["bake"];
  if (report.is_object()) {
    if (!error.empty()) report.erase("error");
    out += "\nbake report\n";
    PrintTree(out, report, 2);
  }
  return out;
}

Status RunInspect(const std::string& path, const CommonWords& common) {
  GLINT_ASSIGN_OR_RETURN(const Archive archive, Archive::Open(path));
  const Json description = DescribeArchive(path, archive);
  if (common.json) {
    PrintJson(description);
  } else {
    std::cout << ToText(description);
  }
  return {};
}

}  // namespace

Command AddInspectCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("inspect", "Show what an archive holds and what it took to bake it");
  const auto path = std::make_shared<std::string>();
  app.add_option("archive", *path, "Archive that 'glint bake' wrote")->required()->type_name("ARCHIVE");
  AddCommonWords(app, common);
  app.footer(
      "Times come from the report ARCHIVE.json beside the archive, if it is there and this archive's.\n"
      "\n"
      "Examples:\n"
      "  glint inspect teapot.glint\n"
      "  glint inspect teapot.glint --json");
  return [path, &common] { return RunInspect(*path, common); };
}

}  // namespace glint
