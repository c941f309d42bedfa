#pragma once

#include <string>
#include <string_view>

#include "core/fields.h"

namespace mvstudio::calib {

/// Unit of length in files that name none.
enum class LengthUnit { kMetre, kCentimetre, kMillimetre, kInch };

inline constexpr ChoiceWords<LengthUnit, 4> kLengthUnits = {
    {{LengthUnit::kMetre, "m"}, {LengthUnit::kCentimetre, "cm"}, {LengthUnit::kMillimetre, "mm"}, {LengthUnit::kInch, "in"}}};

constexpr double MetresPer(LengthUnit unit) {
  constexpr double kMetres[] = {1, 1e-2, 1e-3, 0.0254};
  return kMetres[static_cast<int>(unit)];
}

inline std::string_view ToString(LengthUnit unit) { return WordOf(kLengthUnits, unit); }
/// Throws UsageError that names `option`.
inline void FromString(const std::string& text, const std::string& option, LengthUnit* unit) {
  *unit = KnownChoice(kLengthUnits, text, "option '" + option + "' '" + text + "': expected m, cm, mm or in");
}

}  // namespace mvstudio::calib
