#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

namespace glint {

/// The report of a bake, from a file that anybody may have written: a JSON object, or null for anything else
/// and for what is nested too deeply or too large to be one. Says nothing of the types inside. Does not
/// throw.
nlohmann::ordered_json ParseReport(std::string_view text);

}  // namespace glint
