#include "tools/chart/tables.h"

#include <algorithm>
#include <cstdio>

namespace glint::chart {
namespace {

using Json = nlohmann::ordered_json;

std::string Figure(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string ValueOf(const Point& point, const std::string& word) {
  for (const auto& [w, value] : point.values) {
    if (w == word) return value;
  }
  return "";
}

Json DescribePoint(const MeasuredPoint& p) {
  Json settings = Json::object();
  for (const auto& [word, value] : p.point.values) settings[word] = Json::parse(value, nullptr, false);
  return {{"name", p.point.name},
          {"method", p.point.method},
          {"settings", settings},
          {"seconds", p.seconds},
          {"cpu_seconds", p.cpu_seconds},
          {"bytes", p.bytes},
          {"rel_mse_block4", p.blocks.rel_mse},
          {"mean_relative_block4", p.blocks.mean_relative},
          {"rel_mse", p.pixels.rel_mse},
          {"flip", p.pixels.flip},
          {"mean", p.pixels.mean_test},
          {"mean_reference", p.pixels.mean_reference},
          {"render_seconds", p.render_seconds},
          {"on_seconds_front", p.on_seconds_front},
          {"on_bytes_front", p.on_bytes_front},
          {"measured_at", p.measured_at},
          {"kept", p.kept},
          {"record", "points/" + p.key.Hex() + ".json"}};
}

Json DescribeVector(const glm::vec3& v) { return {v.x, v.y, v.z}; }

}  // namespace

std::string CleanUtf8(const std::string& text) {
  return Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace)).get<std::string>();
}

std::string ChartCsv(const Measured& measured) {
  std::string csv = "name,method";
  for (const Axis& axis : Axes()) csv += "," + CsvField(axis.word);
  csv +=
      ",seconds,cpu_seconds,bytes,rel_mse_block4,mean_relative_block4,rel_mse,flip,render_seconds,on_seconds_"
      "front,"
      "on_bytes_front,kept,measured_at,key\r\n";
  for (const MeasuredPoint& p : measured.points) {
    csv += CsvField(p.point.name) + "," + CsvField(p.point.method);
    for (const Axis& axis : Axes()) csv += "," + CsvField(ValueOf(p.point, axis.word));
    for (const double value : {p.seconds, p.cpu_seconds, p.bytes, p.blocks.rel_mse, p.blocks.mean_relative,
                               p.pixels.rel_mse, p.pixels.flip, p.render_seconds}) {
      csv += "," + Figure(value);
    }
    for (const bool value : {p.on_seconds_front, p.on_bytes_front, p.kept}) csv += value ? ",1" : ",0";
    csv += "," + CsvField(p.measured_at) + "," + p.key.Hex() + "\r\n";
  }
  return csv;
}

Json ChartJson(const Input& input, const Measured& measured) {
  const View& view = input.view;
  const MeasuredReference& reference = measured.reference;
  Json json{{"scene", CleanUtf8(input.scene_name)},
            {"environment", CleanUtf8(input.environment_name)},
            {"camera",
             {{"name", CleanUtf8(view.camera.name)},
              {"eye", DescribeVector(view.camera.eye)},
              {"forward", DescribeVector(view.camera.forward)},
              {"up", DescribeVector(view.camera.up)},
              {"vertical_fov_rad", view.camera.vertical_fov}}},
            {"width", view.width},
            {"height", view.height},
            {"environment_rotation_deg", view.environment_rotation_deg},
            {"samples", input.samples},
            {"threads", measured.threads},
            {"reference",
             {{"brdf", input.reference.lobes ? "lobes" : "true"},
              {"bounces", input.reference.bounces},
              {"samples", input.reference.samples},
              {"seed", input.reference.seed},
              {"noise_rel_mse", reference.noise},
              {"noise_block4_rel_mse", reference.noise_blocks},
              {"seconds", reference.seconds},
              {"kept", reference.kept},
              {"record", "points/" + reference.key.Hex() + ".json"}}}};
  json["points"] = Json::array();
  for (const MeasuredPoint& p : measured.points) json["points"].push_back(DescribePoint(p));
  return json;
}

std::string ChartText(const Measured& measured) {
  size_t width = 5;
  for (const MeasuredPoint& p : measured.points) width = std::max(width, p.point.name.size());
  const auto pad = [width](std::string text) {
    text.resize(std::max(width, text.size()), ' ');
    return text;
  };
  std::string text = pad("point") + "   bake s     cpu s        MB  relMSE 4x4     relMSE    FLIP  front\n";
  for (const MeasuredPoint& p : measured.points) {
    char line[160];
    std::snprintf(line, sizeof line, " %8.2f  %8.2f %9.3f  %10.3g %10.3g  %6.4f  %s%s%s", p.seconds,
                  p.cpu_seconds, 1e-6 * p.bytes, p.blocks.rel_mse, p.pixels.rel_mse, p.pixels.flip,
                  p.on_seconds_front ? "seconds " : "", p.on_bytes_front ? "bytes " : "",
                  p.kept ? "(kept)" : "");
    std::string whole = pad(p.point.name) + line;
    whole.resize(whole.find_last_not_of(' ') + 1);
    text += whole + "\n";
  }
  char noise[96];
  std::snprintf(noise, sizeof noise, "noise of the reference: relMSE %.3g in 4x4 blocks, %.3g in pixels\n",
                measured.reference.noise_blocks, measured.reference.noise);
  return text + noise;
}

}  // namespace glint::chart
