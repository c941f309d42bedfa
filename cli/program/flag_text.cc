#include "cli/program/flag_text.h"

#include <regex>

#include "core/text/short_numbers.h"

namespace mvstudio::cli {
namespace {

void NameFlagsIn(nlohmann::ordered_json* value) {
  if (value->is_string()) {
    *value = WithFlags(value->get<std::string>());
  } else if (value->is_structured()) {
    for (nlohmann::ordered_json& item : *value) NameFlagsIn(&item);
  }
}

}  // namespace

std::string WithFlags(const std::string& text) {
  constexpr char kWord[] = "option '";
  if (text.find(kWord) == std::string::npos) return ShortNumbers(text);
  static const std::regex option("\\boption '([a-z0-9][a-z0-9-]*)'");
  return ShortNumbers(std::regex_replace(text, option, "--$1"));
}

CommandResult NamedFlags(CommandResult result) {
  for (std::vector<Notice>* notices : {&result.warnings, &result.errors}) {
    for (Notice& notice : *notices) notice.text = WithFlags(notice.text), notice.hint = WithFlags(notice.hint);
  }
  result.text = WithFlags(result.text);
  NameFlagsIn(&result.metrics);
  return result;
}

}  // namespace mvstudio::cli
