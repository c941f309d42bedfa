#pragma once

#include <type_traits>
#include <utility>

namespace mvstudio {

/// How a field of options (core/fields.h) is typed, where its type does not tell.
enum class OptionStyle {
  kSwitch,    ///< bool: can be switched on alone
  kUnset,     ///< what it is unless given is said by its help, not by its default
  kList,      ///< texts: one value, with commas between them
  kRepeated,  ///< choices: several may follow the option's name
  kCameras,   ///< cameras' names with commas, or nothing for all
  kFolder,    ///< text: a folder that is written
  kFile,      ///< text: a file that is written
  kPlace,     ///< text: a file or a folder that is written
};

template <class Visitor, class Value, class = void>
inline constexpr bool kKnowsStyles = false;
template <class Visitor, class Value>
inline constexpr bool
    kKnowsStyles<Visitor, Value,
                 std::void_t<decltype(std::declval<Visitor&>().Styled(OptionStyle::kSwitch, "", std::declval<Value&>(), ""))>> =
        true;

/// Within VisitFields: `visit(name, value, help)` for visitors that know no styles.
template <class Visitor, class Value, class Help>
void VisitStyled(Visitor& visit, [[maybe_unused]] OptionStyle style, const char* name, Value& value, const Help& help) {
  if constexpr (kKnowsStyles<Visitor, Value>) {
    visit.Styled(style, name, value, help);
  } else {
    visit(name, value, help);
  }
}

}  // namespace mvstudio
