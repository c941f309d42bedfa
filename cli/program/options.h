#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "cli/program/flag_text.h"
#include "core/fields.h"
#include "core/join.h"

/// What a file that declares options includes; CLI11's header costs seconds in every file that does.
namespace mvstudio::cli {

/// `app.add_option()` and `app.add_flag()`. CLI11's templates are compiled once for each type, in options.cc, and not in every
/// file.
template <class T>
CLI::Option* AddOption(CLI::App* app, const std::string& name, T& value, const std::string& help = "");
CLI::Option* AddFlag(CLI::App* app, const std::string& name, bool& value, const std::string& help);
/// An option of a few words: `set` takes the one that was typed and throws UsageError for another; `now` says the default.
CLI::Option* AddWordOption(CLI::App* app, const std::string& name, const std::function<void(const std::string&)>& set,
                           const std::function<std::string()>& now, const std::string& help);

/// The same for a value with words, see core/fields.h.
template <class T>
CLI::Option* AddChoice(CLI::App* app, const std::string& name, T& value, const std::string& help) {
  return AddWordOption(
      app, name, [&value, name](const std::string& text) { SetFromString(text, name.substr(2), &value); },
      [&value] { return std::string(ToString(value)); }, help);
}
/// For several values, each of them of a word of its own.
CLI::Option* AddWordsOption(CLI::App* app, const std::string& name,
                            const std::function<void(const std::vector<std::string>&)>& set,
                            const std::function<std::string()>& now, const std::string& help);
template <class T>
CLI::Option* AddChoices(CLI::App* app, const std::string& name, std::vector<T>& values, const std::string& help) {
  const auto set = [&values, name](const std::vector<std::string>& texts) {
    std::vector<T> chosen(texts.size());
    for (size_t i = 0; i < texts.size(); ++i) SetFromString(texts[i], name.substr(2), &chosen[i]);
    values = std::move(chosen);
  };
  const auto now = [&values] { return Join(values, ",", [](const T& value) { return std::string(ToString(value)); }); };
  return AddWordsOption(app, name, set, now, help);
}

template <class T>
inline constexpr bool kIsListOfChoices = false;
template <class T>
inline constexpr bool kIsListOfChoices<std::vector<T>> = kHasWords<T> || kHasSharedWords<T>;

/// Binds every field of an options struct (see core/fields.h) to a flag `--<name>`, with its default shown.
template <class Options>
void AddOptions(CLI::App* sub, Options& options) {
  VisitFields(
      [sub](const std::string& name, auto& value, const std::string& help) {
        using Value = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, bool>) {
          AddFlag(sub, "--" + name + ",!--no-" + name, value, WithFlags(help))->capture_default_str();
        } else if constexpr (kHasWords<Value> || kHasSharedWords<Value>) {
          AddChoice(sub, "--" + name, value, WithFlags(help))->capture_default_str();
        } else if constexpr (kIsListOfChoices<Value>) {
          AddChoices(sub, "--" + name, value, WithFlags(help))->capture_default_str();
        } else {
          AddOption(sub, "--" + name, value, WithFlags(help))->capture_default_str();
        }
      },
      options);
}

}  // namespace mvstudio::cli
