#pragma once

#include <nlohmann/json_fwd.hpp>

#include "common/base/status.h"
#include "common/domain/bake_settings.h"

namespace glint {

/// Every field of the settings, by its name in the struct; numbers with the digits that give the same value
/// back.
nlohmann::ordered_json SettingsToJson(const BakeSettings& settings);
/// All fields must be there and within what a bake takes. kBadInput naming the field.
Result<BakeSettings> SettingsFromJson(const nlohmann::ordered_json& json);

}  // namespace glint
