#include "tools/report.h"

#include <algorithm>
#include <cstddef>
#include <cstdio>

#include "coordinator/error_estimate.h"

namespace glint {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMaxBytes = size_t{16} << 20;
constexpr int kMaxDepth = 16;  ///< reports have 3; copying and printing JSON recurses

/// Levels of arrays and objects in a JSON text; for other texts some number.
int Depth(std::string_view text) {
  int depth = 0, deepest = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') in_string = !in_string;
    if (in_string && c == '\\') ++i;  // what is escaped ends no string
    if (in_string) continue;
    if (c == '[' || c == '{') deepest = std::max(deepest, ++depth);
    if (c == ']' || c == '}') --depth;
  }
  return deepest;
}

/// What is said of all layers or of one is all there, in numbers.
bool IsErrorSummary(const Json& summary) {
  const auto is_number = [](const Json& object, const char* key) {
    const auto value = object.find(key);
    return value != object.end() && value->is_number();
  };
  if (!summary.is_object()) return false;
  for (const char* key : {"rms", "uncertainty", "p95", "worst"})
    if (!is_number(summary, key)) return false;
  const auto causes = summary.find("causes");
  if (causes == summary.end() || !causes->is_object()) return false;
  return std::all_of(kErrorCauseNames.begin(), kErrorCauseNames.end(),
                     [&](const char* cause) { return is_number(*causes, cause); });
}

bool IsErrorEstimate(const Json& error) {
  if (!error.is_object()) return false;
  const auto slices = error.find("slices"), all = error.find("all"), layers = error.find("layers");
  return slices != error.end() && slices->is_number_unsigned() && all != error.end() &&
         IsErrorSummary(*all) && layers != error.end() && layers->is_array() &&
         std::all_of(layers->begin(), layers->end(), IsErrorSummary);
}

/// "name" and the summary's figures in columns.
std::string ErrorRow(const std::string& name, const Json& summary) {
  char cell[32];
  std::string row = name + std::string(name.size() < 6 ? 6 - name.size() : 0, ' ');
  const auto add = [&](const Json& value) {
    std::snprintf(cell, sizeof cell, " %8.4f", value.get<double>());
    row += cell;
  };
  for (const char* key : {"rms", "uncertainty", "p95", "worst"}) add(summary[key]);
  for (const char* cause : kErrorCauseNames) add(summary["causes"][cause]);
  return row + '\n';
}

}  // namespace

std::string ErrorLine(const Json& error) {
  if (!IsErrorEstimate(error)) return {};
  const Json& all = error["all"];
  char text[160];
  std::snprintf(text, sizeof text, "%.3f +- %.3f rms, below %.3f for 95 %% of %llu slices (",
                all["rms"].get<double>(), all["uncertainty"].get<double>(), all["p95"].get<double>(),
                error["slices"].get<unsigned long long>());
  std::string line = text;
  for (const char* cause : kErrorCauseNames) {
    std::snprintf(text, sizeof text, "%s%s %.3f", cause == kErrorCauseNames[0] ? "" : ", ", cause,
                  all["causes"][cause].get<double>());
    line += text;
  }
  return line + ")";
}

std::string ErrorTable(const Json& error) {
  if (!IsErrorEstimate(error)) return {};
  char cell[32];
  std::string table = "error ";
  for (const char* head : {"rms", "+-", "p95", "worst"}) {
    std::snprintf(cell, sizeof cell, " %8s", head);
    table += cell;
  }
  for (const char* cause : kErrorCauseNames) {
    std::snprintf(cell, sizeof cell, " %8s", cause);
    table += cell;
  }
  table += '\n' + ErrorRow("all", error["all"]);
  for (size_t i = 0; i < error["layers"].size(); ++i)
    table += ErrorRow(std::to_string(i), error["layers"][i]);
  return table;
}

Json ParseReport(std::string_view text) {
  if (text.size() > kMaxBytes || Depth(text) > kMaxDepth) return {};
  Json report = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  return report.is_object() ? report : Json();
}

}  // namespace glint
