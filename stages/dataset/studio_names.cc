#include "stages/dataset/studio_names.h"

#include <cctype>
#include <utility>

#include "core/error.h"
#include "dataset/panoptic/sequence.h"

namespace mvstudio::stages {
namespace {

using Json = nlohmann::ordered_json;
using Names = std::map<std::string, std::string>;

bool IsWordPart(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '/' || c == '-'; }

/// Whether a word may end before `at`: "00_01." ends a sentence, "00_01.png" is a file.
bool EndsAt(const std::string& text, size_t at) {
  if (at >= text.size()) return true;
  if (text[at] == '.') return at + 1 >= text.size() || !std::isalnum(static_cast<unsigned char>(text[at + 1]));
  return !IsWordPart(text[at]);
}

Json WithNames(const Json& json, const Names& names) {
  if (json.is_string()) return stages::WithNames(json.get<std::string>(), names);
  if (!json.is_structured()) return json;
  Json named = json.is_array() ? Json::array() : Json::object();
  for (const auto& [key, value] : json.items()) {
    if (json.is_array()) named.push_back(WithNames(value, names));
    if (json.is_object()) named[stages::WithNames(key, names)] = WithNames(value, names);
  }
  return named;
}

}  // namespace

std::string WithNames(const std::string& text, const Names& names) {
  std::string out;
  for (size_t at = 0; at < text.size();) {
    const bool begins = at == 0 || !IsWordPart(text[at - 1]);
    const std::pair<const std::string, std::string>* found = nullptr;
    if (begins) {
      for (const auto& name : names) {
        if (text.compare(at, name.first.size(), name.first) == 0 && EndsAt(text, at + name.first.size())) found = &name;
      }
    }
    out += found ? found->second : std::string(1, text[at]);
    at += found ? found->first.size() : 1;
  }
  return out;
}

std::map<std::string, std::string> StudioNames(const std::string& dataset_folder) {
  Names names;
  try {
    for (const auto& [alias, panoptic] : dataset::ReadPanopticAliases(dataset_folder)) names[panoptic] = alias;
  } catch (const Error&) {  // its reader says what is wrong
    names.clear();
  }
  return names;
}

CommandResult NamedCameras(CommandResult result, const Names& names) {
  if (names.empty()) return result;
  result.metrics = WithNames(result.metrics, names);
  result.text = WithNames(result.text, names);
  for (auto* notices : {&result.warnings, &result.errors}) {
    for (Notice& notice : *notices) notice.text = WithNames(notice.text, names), notice.hint = WithNames(notice.hint, names);
  }
  return result;
}

}  // namespace mvstudio::stages
