#pragma once

#include <string>
#include <string_view>

#include "core/fields.h"

namespace mvstudio {

/// Whether a model has a term: what held-out data say, or what was asked for.
enum class AutoOnOff { kAuto, kOn, kOff };

inline constexpr ChoiceWords<AutoOnOff, 3> kAutoOnOffWords = {
    {{AutoOnOff::kAuto, "auto"}, {AutoOnOff::kOn, "on"}, {AutoOnOff::kOff, "off"}}};

inline std::string_view ToString(AutoOnOff choice) { return WordOf(kAutoOnOffWords, choice); }
/// Throws UsageError that names `option`.
inline void FromString(const std::string& text, const std::string& option, AutoOnOff* choice) {
  *choice = KnownChoice(kAutoOnOffWords, text, "option '" + option + "' " + text + ": expected auto, on or off");
}

}  // namespace mvstudio
