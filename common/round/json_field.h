#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>

#include "common/base/status.h"

namespace glint {

/// The number at `name`, from `low` to `high`; an integer where T is one. kBadInput naming the field.
template <class T>
Status ReadNumber(const nlohmann::ordered_json& json, const char* name, T low, T high, T* out) {
  const auto field = json.find(name);
  bool fits = field != json.end();
  if constexpr (std::is_floating_point_v<T>) {
    fits = fits && field->is_number();
    if (fits) *out = field->template get<T>();
  } else if constexpr (std::is_signed_v<T>) {
    fits = fits && field->is_number_integer() && field->template get<int64_t>() == field->template get<T>();
    if (fits) *out = field->template get<T>();
  } else {
    fits = fits && field->is_number_unsigned() && field->template get<uint64_t>() <= high;
    if (fits) *out = field->template get<T>();
  }
  if (fits && *out >= low && *out <= high) return {};
  return BadInput("field '" + std::string(name) + "' is not a number from " + std::to_string(low) + " to " +
                  std::to_string(high));
}

}  // namespace glint
