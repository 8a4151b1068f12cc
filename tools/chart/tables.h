#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tools/chart/chart.h"

namespace glint::chart {

/// One line a point (RFC 4180); a field of an axis that does not matter to the method is empty.
std::string ChartCsv(const Measured& measured);
/// The whole chart without pictures. All text in it is valid UTF-8.
nlohmann::ordered_json ChartJson(const Input& input, const Measured& measured);
/// For people at a terminal, ends with a line end.
std::string ChartText(const Measured& measured);

/// `text` with what is not UTF-8 replaced by U+FFFD.
std::string CleanUtf8(const std::string& text);

}  // namespace glint::chart
