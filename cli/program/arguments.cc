#include "cli/program/arguments.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <system_error>

#include "cli/program/options.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "core/text/words.h"

namespace mvstudio::cli {
namespace {

constexpr int kMaxThreads = 4096;

/// Options that count, but know -1 for "all" or "as before"; so do those whose default is -1.
const std::pair<const char*, const char*> kMayBeMinusOne[] = {{"eval", "--renders"}, {"resume", "--steps"}};

std::string Quoted(const std::string& text) { return "'" + text + "'"; }

template <class Number>
bool ParseWhole(std::string text, Number* number) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.erase(0, 1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  const size_t digits = text.find_first_not_of('-');  // 010 would be read as eight
  const bool padded = digits != std::string::npos && digits + 1 < text.size() && text[digits] == '0';
  return error == std::errc() && end == text.data() + text.size() && !padded;
}

std::string IntegerFault(const std::string& text, int least, int most) {
  int64_t number = 0;
  if (!ParseWhole(text, &number)) return Quoted(text) + " is not a whole number";
  if (number >= least && number <= most) return "";
  const bool bounded = number > most || most < std::numeric_limits<int>::max();
  return Quoted(text) + " must be " + std::to_string(least) + (bounded ? " to " + std::to_string(most) : " or more");
}

std::string UnsignedFault(const std::string& text) {
  uint64_t number = 0;
  if (ParseWhole(text, &number)) return "";
  return Quoted(text) + " is not a whole number from 0 to " + std::to_string(std::numeric_limits<uint64_t>::max());
}

std::string RealFault(const std::string& text) {
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0') return Quoted(text) + " is not a number";
  return std::isfinite(number) ? "" : Quoted(text) + " is not a finite number";
}

std::string TextFault(const std::string& text) {
  if (text.empty()) return "is empty; give a path or a value";
  // One word: a value of several, as of `tradeoff avatar --train "--downs 2"`, is no flag that follows.
  if (text.size() > 2 && text.compare(0, 2, "--") == 0 && text.find(' ') == std::string::npos)
    return "the value is missing before " + Quoted(text) + " (a name that begins with dashes is given as ./" + text + ")";
  return "";
}

std::string FlagFault(const std::string& text) {
  const char* const known[] = {"true", "false", "on", "off", "yes", "no", "1", "0", "-1"};
  const bool is_known = std::find(std::begin(known), std::end(known), text) != std::end(known);
  return is_known ? "" : Quoted(text) + " is neither true nor false";
}

bool BeginsWith(const std::string& text, const std::string& head) { return text.compare(0, head.size(), head) == 0; }

/// Only the type's own check; its text is not shown in the help.
CLI::Validator Checked(std::function<std::string(const std::string&)> fault) {
  return CLI::Validator([fault = std::move(fault)](std::string& text) { return fault(text); }, "");
}

void CheckIntegers(const std::string& command, CLI::Option* option) {
  const std::string name = option->get_name();
  bool minus_one = option->get_default_str() == "-1";
  for (const auto& [of, known] : kMayBeMinusOne) minus_one = minus_one || (command == of && name == known);
  const bool threads = BeginsWith(name, "--threads");
  const int most = threads ? kMaxThreads : std::numeric_limits<int>::max();
  option->check(Checked([=](const std::string& text) { return IntegerFault(text, minus_one ? -1 : 0, most); }));
}

void CheckValue(const std::string& command, CLI::Option* option) {
  const std::string type = option->get_type_name();
  if (BeginsWith(type, "INT")) return CheckIntegers(command, option);
  if (BeginsWith(type, "UINT")) option->check(Checked(UnsignedFault));
  if (BeginsWith(type, "FLOAT")) option->check(Checked(RealFault));
  if (BeginsWith(type, "TEXT")) option->check(Checked(TextFault));
  if (type.empty() && option->get_items_expected_max() == 0) option->check(Checked(FlagFault));
}

const CLI::App& Deepest(const CLI::App& app) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  return parsed.empty() ? app : Deepest(*parsed.back());
}

/// "calib show"; empty for the program itself.
std::string PathOf(const CLI::App& app) {
  if (app.get_parent() == nullptr) return "";
  const std::string parent = PathOf(*app.get_parent());
  return parent + (parent.empty() ? "" : " ") + app.get_name();
}

std::vector<std::string> SubcommandNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) names.push_back(sub->get_name());
  return names;
}

std::vector<std::string> FlagNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* at = &app; at; at = at->get_parent()) {
    for (const CLI::Option* option : at->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  return names;
}

std::string Suggestion(const std::string& nearest) { return nearest.empty() ? "" : "; did you mean " + Quoted(nearest) + "?"; }

/// Of all commands below `app`, those whose last word is `word`: "session init" of "init".
std::vector<std::string> CommandsNamed(const CLI::App& app, const std::string& word) {
  std::vector<std::string> paths;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (sub->get_name() == word) paths.push_back(Quoted(PathOf(*sub)));
    const std::vector<std::string> below = CommandsNamed(*sub, word);
    paths.insert(paths.end(), below.begin(), below.end());
  }
  return paths;
}

std::string UnknownCommand(const CLI::App& app, const std::string& word) {
  const std::string path = PathOf(app);
  const std::string text = "unknown command " + Quoted(path + (path.empty() ? "" : " ") + word);
  const CLI::App* root = &app;
  while (root->get_parent()) root = root->get_parent();
  const std::vector<std::string> same = CommandsNamed(*root, word);
  if (!same.empty()) return text + "; did you mean " + Join(same, " or ") + "?";
  const std::string nearest = NearestWord(word, SubcommandNames(app));
  const std::string plots = BeginsWith(word, "plot") ? "; plots are on the page of mvstudio report" : "";
  return text + (nearest.empty() ? "; there are " + Join(SubcommandNames(app), ", ") + plots : Suggestion(nearest));
}

/// Of -o the only flag with that letter, or --out; else nothing.
std::string LongFlag(const std::string& letter, const std::vector<std::string>& flags) {
  std::vector<std::string> with_letter;
  for (const std::string& flag : flags) {
    if (flag == "--out" && letter == "-o") return flag;
    if (BeginsWith(flag, "-" + letter)) with_letter.push_back(flag);
  }
  return with_letter.size() == 1 ? with_letter[0] : "";
}

/// A session is named by a flag, by most commands.
std::string UnexpectedArgument(const CLI::App& app, const std::string& word) {
  std::error_code none;
  const bool session =
      app.get_option_no_throw("--session") && std::filesystem::exists(std::filesystem::path(word) / "mvstudio.toml", none);
  return "unexpected argument " + Quoted(word) + (session ? "; did you mean --session " + ShellWord(word) + "?" : "");
}

std::string UnknownFlag(const CLI::App& app, const std::string& word) {
  const std::string name = word.substr(0, word.find('='));
  const std::vector<std::string> flags = FlagNames(app);
  return "unknown flag " + Quoted(name) + Suggestion(name.size() == 2 ? LongFlag(name, flags) : NearestWord(name, flags));
}

bool IsFlag(const std::string& word) { return word.size() > 1 && word[0] == '-'; }

/// "--units is required: m, cm or mm": what the help says of the option that is missing.
std::string WithMeaning(const CLI::App& app, const std::string& text) {
  const size_t end = text.find(" is required");
  for (const CLI::Option* option : app.get_options()) {
    if (end != std::string::npos && option->get_name() == text.substr(0, end))
      return text + ": " + option->get_description().substr(0, option->get_description().find("; "));
  }
  return text;
}

std::string FaultText(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App* root = &app;
  const CLI::App& current = Deepest(*root);
  const std::vector<std::string> rest = root->remaining(true);
  const bool group = !SubcommandNames(current).empty();
  auto word = rest.begin();
  if (!group) {
    word = std::find_if(rest.begin(), rest.end(), IsFlag);
    if (word == rest.end() && dynamic_cast<const CLI::ExtrasError*>(&error)) word = rest.begin();
  }
  if (word != rest.end()) {
    if (IsFlag(*word)) return UnknownFlag(current, *word);
    return group ? UnknownCommand(current, *word) : UnexpectedArgument(current, *word);
  }
  if (!group || !dynamic_cast<const CLI::RequiredError*>(&error)) return WithMeaning(current, error.what());
  const std::string path = PathOf(current);
  return path.empty() ? "no command given"
                      : Quoted(path) + " needs one of its commands: " + Join(SubcommandNames(current), ", ");
}

}  // namespace

void CheckValues(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) CheckValue(app.get_name(), option);
  for (CLI::App* sub : app.get_subcommands([](CLI::App*) { return true; })) CheckValues(*sub);
}

CLI::Validator OneOf(const std::vector<std::string>& names) {
  const auto find = [names](std::string& text) {
    for (const std::string& name : names) {
      if (name != text && (text.empty() || PlainWord(name) != PlainWord(text))) continue;
      text = name;
      return std::string();
    }
    return Quoted(text) + " is none of " + Join(names, ", ") + DidYouMean(text, names);
  };
  return CLI::Validator(find, "");
}

Notice ParseNotice(const CLI::App& app, const CLI::ParseError& error) {
  const std::string path = PathOf(Deepest(app));
  return {"CLI-USAGE", FaultText(app, error), "see mvstudio " + path + (path.empty() ? "" : " ") + "--help"};
}

}  // namespace mvstudio::cli
