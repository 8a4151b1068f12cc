#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace glint {

/// The report of a bake, from a file that anybody may have written: a JSON object, or null for anything else
/// and for what is nested too deeply or too large to be one. Says nothing of the types inside. Does not
/// throw.
nlohmann::ordered_json ParseReport(std::string_view text);

/// The "error" of a bake's report (ErrorEstimate) in one line; empty if it is not such a thing.
std::string ErrorLine(const nlohmann::ordered_json& error);
/// The same as a table: all layers, then each, with the causes; empty if it is not such a thing.
std::string ErrorTable(const nlohmann::ordered_json& error);

}  // namespace glint
