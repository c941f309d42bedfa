#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "core/error.h"

/// The one list of the fields of an options struct. Beside each struct `Options` stands
///
///     template <class Visitor>
///     void VisitFields(Visitor&& visit, Options& o) {
///       visit("max-error-px", o.max_error_px, "px; views with a larger residual are dropped");
///     }
///
/// and command-line flags, provenance and the tables of docs/cli.md all come from it. Field types: bool, int, int64_t,
/// uint64_t, double, std::string, std::vector<std::string>, and choices of a few words.
/// A library knows no flags: its texts name an option as `option 'max-error-px'`, of which the program makes its flag.
///
/// A choice of a few words is an `enum class`. Beside it stand, both over one table of its words,
///
///     std::string_view ToString(Quality quality);                  ///< "fast", "balanced"
///     void FromString(const std::string& text, Quality* quality);  ///< throws UsageError for any other word
///
/// A struct that is read from a word has the same two. A choice that several options share is told the option's name for its
/// refusal: FromString(text, "warp", &choice). A field may be a std::vector of either.
namespace mvstudio {

/// Calls `visit(name, value, help)` for each field of a const options struct.
template <class Visitor, class Options>
void VisitConstFields(Visitor&& visit, const Options& options) {
  Options copy = options;
  VisitFields(visit, copy);
}

template <class Choice, size_t N>
using ChoiceWords = std::array<std::pair<Choice, std::string_view>, N>;

/// The word of a choice; empty for a value that is not in the table.
template <class Choice, size_t N>
std::string_view WordOf(const ChoiceWords<Choice, N>& words, Choice choice) {
  for (const auto& [value, word] : words) {
    if (value == choice) return word;
  }
  return {};
}

/// The choice of a word; nothing for an unknown one.
template <class Choice, size_t N>
std::optional<Choice> ChoiceOf(const ChoiceWords<Choice, N>& words, std::string_view text) {
  for (const auto& [value, word] : words) {
    if (word == text) return value;
  }
  return std::nullopt;
}

/// The same; throws UsageError with the text `refusal` for an unknown word.
template <class Choice, size_t N>
Choice KnownChoice(const ChoiceWords<Choice, N>& words, std::string_view text, const std::string& refusal) {
  const std::optional<Choice> choice = ChoiceOf(words, text);
  if (!choice) throw UsageError(refusal);
  return *choice;
}

/// Whether T has a FromString of its own.
template <class T, class = void>
inline constexpr bool kHasWords = false;
template <class T>
inline constexpr bool kHasWords<T, std::void_t<decltype(FromString(std::string(), static_cast<T*>(nullptr)))>> = true;

/// Whether T has a FromString that takes an option's name.
template <class T, class = void>
inline constexpr bool kHasSharedWords = false;
template <class T>
inline constexpr bool
    kHasSharedWords<T, std::void_t<decltype(FromString(std::string(), std::string(), static_cast<T*>(nullptr)))>> = true;

/// `value` as `text` says, which is that of the option `option`. Throws UsageError.
template <class T>
void SetFromString(const std::string& text, const std::string& option, T* value) {
  if constexpr (kHasSharedWords<T>) {
    FromString(text, option, value);
  } else {
    FromString(text, value);
  }
}

}  // namespace mvstudio
