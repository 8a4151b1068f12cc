#include "tools/report.h"

#include <algorithm>
#include <cstddef>

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

}  // namespace

Json ParseReport(std::string_view text) {
  if (text.size() > kMaxBytes || Depth(text) > kMaxDepth) return {};
  Json report = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  return report.is_object() ? report : Json();
}

}  // namespace glint
