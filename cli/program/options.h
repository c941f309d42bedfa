#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "cli/program/flag_text.h"
#include "core/choice/option_style.h"
#include "core/disk/place.h"
#include "core/fields.h"
#include "core/join.h"

/// What a file that declares options includes; CLI11's header costs seconds in every file that does.
namespace mvstudio::cli {

/// `app.add_option()` and `app.add_flag()`. CLI11's templates are compiled once for each type, in options.cc, and not in every
/// file.
template <class T>
CLI::Option* AddOption(CLI::App* app, const std::string& name, T& value, const std::string& help = "");
CLI::Option* AddFlag(CLI::App* app, const std::string& name, bool& value, const std::string& help);
/// An option, or an argument, for the place of an output: what is typed becomes its one name (core/disk/place.h).
CLI::Option* AddOutput(CLI::App* app, const std::string& name, std::string& value, OutputKind kind, const std::string& help);
void NameOutput(CLI::Option* option, OutputKind kind);
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

/// Names of the options that were typed, without dashes.
std::set<std::string> GivenOptions(const CLI::App* sub);

/// The heading in help of the options that are added to `sub` from here on.
void StartGroup(CLI::App* sub, const std::string& subject);
std::string GroupOf(const CLI::App* sub);

/// A heading for the options that are added while it lives.
class GroupScope {
 public:
  GroupScope(CLI::App* sub, const std::string& subject) : sub_(sub), before_(GroupOf(sub)) { StartGroup(sub, subject); }
  ~GroupScope() { StartGroup(sub_, before_); }
  GroupScope(const GroupScope&) = delete;
  GroupScope& operator=(const GroupScope&) = delete;

 private:
  CLI::App* sub_;
  std::string before_;
};

/// An option that takes names with commas between them, or nothing.
template <class T>
CLI::Option* AddNames(CLI::App* app, const std::string& name, T& value, const std::string& help) {
  const auto set = [&value, name](const std::vector<std::string>& texts) {
    SetFromString(Join(texts, ","), name.substr(2), &value);
  };
  return AddWordsOption(
             app, name, set, [&value] { return std::string(ToString(value)); }, help)
      ->expected(0, 1);
}

/// "--unit,--calib-unit" of a field's name, which may hold other names behind commas.
std::string FlagsOf(const std::string& name);

/// A visitor of fields that binds each to a flag.
struct OptionAdder {
  CLI::App* sub;

  template <class Value>
  void operator()(const std::string& name, Value& value, const std::string& help) const {
    if constexpr (std::is_same_v<Value, bool>) {
      AddFlag(sub, "--" + name + ",!--no-" + name, value, WithFlags(help))->capture_default_str();
    } else if constexpr (kHasWords<Value> || kHasSharedWords<Value>) {
      AddChoice(sub, "--" + name, value, WithFlags(help))->capture_default_str();
    } else if constexpr (kIsListOfChoices<Value>) {
      AddChoices(sub, "--" + name, value, WithFlags(help))->capture_default_str();
    } else {
      AddOption(sub, FlagsOf(name), value, WithFlags(help))->capture_default_str();
    }
  }
  /// See core/choice/option_style.h: the style belongs to the type.
  template <class Value>
  void Styled(OptionStyle style, const std::string& name, Value& value, const std::string& help) const {
    if constexpr (std::is_same_v<Value, bool>) {
      AddFlag(sub, "--" + name + (style == OptionStyle::kUnset ? ",!--no-" + name : ""), value, WithFlags(help));
    } else if constexpr (std::is_enum_v<Value>) {
      AddChoice(sub, "--" + name, value, WithFlags(help));
    } else if constexpr (kHasWords<Value> || kHasSharedWords<Value>) {
      AddNames(sub, "--" + name, value, WithFlags(help))->type_name("[CAMERAS]");
    } else if constexpr (kIsListOfChoices<Value>) {
      AddChoices(sub, "--" + name, value, WithFlags(help))->allow_extra_args(true);
    } else {
      CLI::Option* option = AddOption(sub, FlagsOf(name), value, WithFlags(help));
      if (style == OptionStyle::kList) option->delimiter(',');
      if (style == OptionStyle::kFolder) NameOutput(option, OutputKind::kFolder);
      if (style == OptionStyle::kFile) NameOutput(option, OutputKind::kFile);
      if (style == OptionStyle::kPlace) NameOutput(option, OutputKind::kAny);
    }
  }
  void StartGroup(const char* subject) const { cli::StartGroup(sub, subject); }
};

/// Binds every field of an options struct (see core/fields.h) to a flag `--<name>`, with its default shown, under the subjects
/// of its list (core/choice/option_group.h). What is added later has the heading that was there before.
template <class Options>
void AddOptions(CLI::App* sub, Options& options) {
  const GroupScope as_before(sub, GroupOf(sub));
  VisitFields(OptionAdder{sub}, options);
}

}  // namespace mvstudio::cli
