#include <algorithm>
#include <map>
#include <set>

#include "report/compare/compared.h"

/// What differs in the settings of runs, by their command lines and by what results state.
namespace mvstudio::report {
namespace {

using Texts = std::map<std::string, std::string>;

/// Flags that change no number, and those of places, which the inputs tell.
bool IsSilent(const std::string& flag) {
  static const std::set<std::string> kSilent = {"out",   "session", "overwrite", "json",   "quiet",         "redact",
                                                "cache", "threads", "verbose",   "device", "allow-outside", "save-corners"};
  return kSilent.count(flag) > 0;
}

/// Flags of a command line with their values; those with a path among them are left out.
Texts TypedFlags(const Value& argv) {
  Texts flags;
  std::string flag;
  for (const Value& word : argv.items()) {
    const std::string text = word.Text(word.Dump());
    if (text.size() > 2 && text[0] == '-' && text[1] == '-') {
      const size_t equals = text.find('=');
      flag = text.substr(2, equals == std::string::npos ? equals : equals - 2);
      flags[flag] = equals == std::string::npos ? "" : text.substr(equals + 1);
    } else if (!flag.empty()) {
      flags[flag] += (flags[flag].empty() ? "" : " ") + text;
    }
  }
  for (auto at = flags.begin(); at != flags.end();) {
    const bool path = at->second.find('/') != std::string::npos;
    at = path || IsSilent(at->first) ? flags.erase(at) : std::next(at);
  }
  return flags;
}

/// What a result says that it was made with.
Texts StatedSettings(const Stage& stage) {
  Texts texts;
  const Value &metrics = stage.metrics(), &training = metrics["training"];
  for (const char* key : {"method", "backend", "skeleton", "world"}) {
    if (metrics[key].IsText()) texts[key] = metrics[key].Text();
  }
  for (const Value& camera : metrics["cameras"].items()) {
    if (camera["model"].IsText()) texts["lens of " + camera["name"].Text()] = camera["model"].Text();
  }
  for (const auto& [key, value] : training["options"].fields()) {
    if (!IsSilent(key.substr(key.find('.') + 1))) texts[key] = value.Text(value.Dump());
  }
  if (training["cameras"].IsArray()) texts["training cameras"] = std::to_string(training["cameras"].items().size());
  if (training["num_frames"].IsNumber()) texts["training frames"] = training["num_frames"].Dump();
  return texts;
}

Texts SettingsOf(const Stage& stage) {
  Texts texts;
  for (const auto& [flag, value] : TypedFlags(stage.result["argv"])) texts["option " + flag] = value.empty() ? "given" : value;
  texts.merge(StatedSettings(stage));
  texts["version"] = stage.result["version"].Text("?");
  return texts;
}

}  // namespace

std::vector<DifferingText> DifferingSettings(const std::vector<ComparedStage>& stages) {
  std::vector<DifferingText> rows;
  std::set<std::vector<std::string>> versions;  // told once
  for (const ComparedStage& stage : stages) {
    if (!stage.InBoth()) continue;
    std::vector<Texts> of_runs;
    std::set<std::string> names;
    for (const Stage* run : stage.runs) {
      of_runs.push_back(run ? SettingsOf(*run) : Texts());
      for (const auto& [name, text] : of_runs.back()) names.insert(name);
    }
    for (const std::string& name : names) {
      DifferingText row{name == "version" ? "all" : stage.command, name, {}};
      for (const Texts& texts : of_runs) row.texts.push_back(texts.count(name) > 0 ? texts.at(name) : "not given");
      const bool equal = std::all_of(row.texts.begin(), row.texts.end(), [&](const auto& t) { return t == row.texts.front(); });
      if (equal || (name == "version" && !versions.insert(row.texts).second)) continue;
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

}  // namespace mvstudio::report
