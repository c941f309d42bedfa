#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <type_traits>

#include "cli/program/flag_text.h"
#include "core/fields.h"

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
      app, name, [&value](const std::string& text) { FromString(text, &value); },
      [&value] { return std::string(ToString(value)); }, help);
}

/// Binds every field of an options struct (see core/fields.h) to a flag `--<name>`, with its default shown.
template <class Options>
void AddOptions(CLI::App* sub, Options& options) {
  VisitFields(
      [sub](const std::string& name, auto& value, const std::string& help) {
        using Value = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, bool>) {
          AddFlag(sub, "--" + name + ",!--no-" + name, value, WithFlags(help))->capture_default_str();
        } else if constexpr (kHasWords<Value>) {
          AddChoice(sub, "--" + name, value, WithFlags(help))->capture_default_str();
        } else {
          AddOption(sub, "--" + name, value, WithFlags(help))->capture_default_str();
        }
      },
      options);
}

}  // namespace mvstudio::cli
