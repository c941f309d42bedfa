#pragma once

#include <Eigen/Core>
#include <string>
#include <type_traits>

#include "stages/result.h"

/// Reports as JSON. Beside a report's struct stands its one list of fields, as beside options (core/fields.h):
///
///     template <class Visitor>
///     void VisitFields(Visitor&& visit, const LensCheck& c) {
///       visit("rms_px", c.rms_px);
///     }
///
/// The names are the keys, in this order; a field may be in another unit than the member, and may be left out by an `if`.
namespace mvstudio::stages {

/// Null for what is not finite, the word of a choice, an array for a vector.
template <class T>
nlohmann::ordered_json FieldJson(const T& value) {
  if constexpr (std::is_floating_point_v<T>) {
    return FiniteOrNull(value);
  } else if constexpr (std::is_enum_v<T>) {
    return std::string(ToString(value));
  } else if constexpr (std::is_same_v<T, Eigen::Vector2d>) {
    return {FiniteOrNull(value.x()), FiniteOrNull(value.y())};
  } else {
    return value;
  }
}

template <class Report>
void AddFields(const Report& report, nlohmann::ordered_json* json) {
  VisitFields([json](const char* name, const auto& value) { (*json)[name] = FieldJson(value); }, report);
}

template <class Report>
nlohmann::ordered_json FieldsJson(const Report& report) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  AddFields(report, &json);
  return json;
}

/// One object each.
template <class Reports>
nlohmann::ordered_json RowsJson(const Reports& reports) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const auto& report : reports) rows.push_back(FieldsJson(report));
  return rows;
}

}  // namespace mvstudio::stages
