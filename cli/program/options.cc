#include "cli/program/options.h"

#include <cctype>
#include <cstdint>
#include <vector>

#include "cli/program/places.h"
#include "core/error.h"
#include "core/text/words.h"

namespace mvstudio::cli {

template <class T>
CLI::Option* AddOption(CLI::App* app, const std::string& name, T& value, const std::string& help) {
  CLI::Option* option = app->add_option(name, value, help);
  if constexpr (!std::is_arithmetic_v<T> && !std::is_same_v<T, std::string>)
    option->default_function([&value] { return CLI::detail::join(value, ","); });
  return option;
}

template CLI::Option* AddOption(CLI::App*, const std::string&, std::string&, const std::string&);
template CLI::Option* AddOption(CLI::App*, const std::string&, int&, const std::string&);
template CLI::Option* AddOption(CLI::App*, const std::string&, int64_t&, const std::string&);
template CLI::Option* AddOption(CLI::App*, const std::string&, uint64_t&, const std::string&);
template CLI::Option* AddOption(CLI::App*, const std::string&, double&, const std::string&);
template CLI::Option* AddOption(CLI::App*, const std::string&, std::vector<std::string>&, const std::string&);
template CLI::Option* AddOption(CLI::App*, const std::string&, std::vector<double>&, const std::string&);
template CLI::Option* AddOption(CLI::App*, const std::string&, std::vector<int>&, const std::string&);

std::set<std::string> GivenOptions(const CLI::App* sub) {
  std::set<std::string> given;
  for (const CLI::Option* option : sub->get_options()) {
    if (option->count() > 0) given.insert(option->get_lnames().begin(), option->get_lnames().end());
  }
  return given;
}

void StartGroup(CLI::App* sub, const std::string& subject) { sub->option_defaults()->group(subject); }

std::string GroupOf(const CLI::App* sub) { return const_cast<CLI::App*>(sub)->option_defaults()->get_group(); }

std::string FlagsOf(const std::string& name) {
  std::string flags = "--";
  for (const char c : name) flags += c == ',' ? std::string(",--") : std::string(1, c);
  return flags;
}

CLI::Option* AddFlag(CLI::App* app, const std::string& name, bool& value, const std::string& help) {
  return app->add_flag(name, value, help)->default_function([&value] { return value ? "true" : "false"; });
}

CLI::Option* AddOutput(CLI::App* app, const std::string& name, std::string& value, OutputKind kind, const std::string& help) {
  CLI::Option* option = AddOption(app, name, value, help);
  NameOutput(option, kind);
  return option;
}

void NameOutput(CLI::Option* option, OutputKind kind) {
  const auto name = [kind](std::string& text) {
    if (!text.empty()) text = OutputName(text, kind);  // the check of texts says that it is missing
    return std::string();
  };
  option->transform(CLI::Validator(name, "", kind == OutputKind::kFile ? kFileMark : kPlaceMark));
}

namespace {

/// The words of a refusal, which lists those that there are: "expected auto, on or none".
std::vector<std::string> WordsIn(const std::string& text) {
  std::vector<std::string> words(1);
  for (const char c : text) {
    if (std::islower(static_cast<unsigned char>(c)) || std::isdigit(static_cast<unsigned char>(c)) || c == '-' || c == '_') {
      words.back() += c;
    } else if (!words.back().empty()) {
      words.emplace_back();
    }
  }
  return words;
}

/// Takes the word that the typed one means, in any case, with or without hyphens and underscores; the refusal names one that is
/// near.
void SetLeniently(const std::function<void(const std::string&)>& set, const std::string& typed) {
  try {
    set(typed);
  } catch (const UsageError& refusal) {
    std::vector<std::string> known;
    const std::string text = refusal.what();
    const size_t colon = text.find(": ");  // before it stand the option's name and what was typed
    for (const std::string& word : WordsIn(colon == std::string::npos ? text : text.substr(colon))) {
      if (word.empty() || word == typed) continue;
      if (PlainWord(word) == PlainWord(typed)) return set(word);
      known.push_back(word);
    }
    throw UsageError(text + DidYouMean(typed, known));
  }
}

}  // namespace

CLI::Option* AddWordOption(CLI::App* app, const std::string& name, const std::function<void(const std::string&)>& set,
                           const std::function<std::string()>& now, const std::string& help) {
  const auto lenient = [set](const std::string& typed) { SetLeniently(set, typed); };
  return app->add_option_function<std::string>(name, lenient, help)->default_function(now);
}

CLI::Option* AddWordsOption(CLI::App* app, const std::string& name,
                            const std::function<void(const std::vector<std::string>&)>& set,
                            const std::function<std::string()>& now, const std::string& help) {
  return app->add_option_function<std::vector<std::string>>(name, set, help)->default_function(now);
}

}  // namespace mvstudio::cli
