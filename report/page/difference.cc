#include "report/page/difference.h"

namespace mvstudio::report {

std::optional<ValueDifference> FirstDifference(const Value& own, const Value& other, const std::string& field) {
  const std::string prefix = field.empty() ? "" : field + ".";
  if (own.IsObject() && other.IsObject()) {
    for (const auto* side : {&other, &own}) {
      for (const auto& [key, unused] : side->fields()) {
        if (auto found = FirstDifference(own[key], other[key], prefix + key)) return found;
      }
    }
    return std::nullopt;
  }
  if (own.Dump() == other.Dump()) return std::nullopt;
  return ValueDifference{field, own, other};
}

}  // namespace mvstudio::report
