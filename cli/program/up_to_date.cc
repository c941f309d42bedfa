#include "cli/program/up_to_date.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>

#include "cli/program/places.h"
#include "cli/program/redact.h"
#include "cli/program/result.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/join.h"
#include "stages/pipeline/record.h"

namespace mvstudio::cli {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;
using PathSet = std::set<std::string>;

/// A file or folder by its real path, whatever it is called; also behind NAME= and in lists with commas.
std::string ResolvedValue(const std::string& value, std::vector<std::string>* named) {
  std::error_code error;
  const fs::path real = fs::canonical(value, error);
  if (!value.empty() && !error) {
    named->push_back(real.string());
    return real.string();
  }
  if (value.find_first_of("*?[{") != std::string::npos) return (fs::current_path() / value).string();
  if (const size_t name = value.find('='); name != std::string::npos)
    return value.substr(0, name + 1) + ResolvedValue(value.substr(name + 1), named);
  if (const size_t comma = value.find(','); comma != std::string::npos)
    return ResolvedValue(value.substr(0, comma), named) + "," + ResolvedValue(value.substr(comma + 1), named);
  return value.find('/') == std::string::npos ? value : fs::absolute(value).lexically_normal().string();
}

std::string AbsolutePath(const std::string& path) { return IsPattern(path) ? fs::absolute(path).string() : PathOnDisk(path); }

bool IsAtOrBelow(const std::string& path, const std::string& folder) {
  return path.compare(0, folder.size(), folder) == 0 && (path.size() == folder.size() || path[folder.size()] == '/');
}

bool IsCovered(const std::string& path, const PathSet& by) {
  return std::any_of(by.begin(), by.end(), [&](const std::string& folder) { return IsAtOrBelow(path, folder); });
}

bool Holds(const std::string& folder, const PathSet& one_of) {
  return std::any_of(one_of.begin(), one_of.end(), [&](const std::string& path) { return IsAtOrBelow(path, folder); });
}

std::string ResultName(const std::string& command) {
  std::string name = command;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name + ".result.json";
}

/// What the command looks for in a session, whether it is there or not.
void AddSession(const Registry::Entry& entry, const std::string& folder, PathSet* inputs) {
  const dataset::Session session = dataset::ReadSession(folder, true);
  inputs->insert(folder + "/calib/calibration.json");
  for (const dataset::SessionTake& take : session.takes)
    inputs->insert({dataset::TimelinePath(session, take.name), folder + "/sync/" + dataset::Slug(take.name) + "/sync.json"});
  stages::PipelineOptions options;
  options.session = folder, options.allow_outside = true;
  const CLI::Option* take = entry.app->get_option_no_throw("--take");
  if (take && take->count() > 0) options.take = take->as<std::string>();
  try {
    for (const stages::PipelineStage& stage : stages::PipelineOf(session, options)) {
      if ((Join(stage.command, " ") + " ").rfind(entry.name + " ", 0) == 0)
        inputs->insert(stage.inputs.begin(), stage.inputs.end());
    }
  } catch (const UsageError&) {  // has no stages; what the command has read is known all the same
  }
}

PathSet InputsOfLine(const Registry::Entry& entry, const TypedLine& line, const CommandResult& result, const DiskTrace& trace) {
  const PathSet written = trace.published();
  PathSet inputs;
  for (const std::string& path : result.inputs)
    if (!path.empty()) inputs.insert(AbsolutePath(path));
  for (const std::string& path : line.named) {
    if (fs::is_regular_file(path + "/mvstudio.toml")) {
      AddSession(entry, path, &inputs);
    } else {
      inputs.insert(path);
    }
  }
  const std::string own = AbsolutePath(result.folder) + "/" + ResultName(entry.name);
  const PathSet folders = inputs;
  for (const std::string& path : trace.read()) {
    const std::string name = fs::path(path).filename().string();
    const bool record = name.rfind(".mvstudio", 0) == 0 || name == "provenance.jsonl" || path == own;
    const bool result_of = name.find(".result.json") != std::string::npos;  // is not counted among the files of a folder
    if (!record && (result_of || !IsCovered(path, folders))) inputs.insert(path);
  }
  for (auto at = inputs.begin(); at != inputs.end();) at = IsCovered(*at, written) ? inputs.erase(at) : std::next(at);
  return inputs;
}

struct NotJudged {};

/// What was written to during the run may have been read before or after: a file that is newer than `newest_ns` is not judged,
/// unless it lies in a folder that holds what was `written`.
Json PrintsOf(const PathSet& paths, const PathSet& written, int64_t newest_ns) {
  Json prints = Json::array();
  for (const std::string& path : paths) {
    const stages::Fingerprint print = stages::FingerprintOf(path);
    std::error_code ignored;
    const bool there = fs::exists(fs::symlink_status(path, ignored));
    const bool changed = print.newest_ns > newest_ns && !Holds(path, written);
    if (changed || print.links || (there && !print.error.empty())) throw NotJudged();
    prints.push_back(PrintJson(print));
  }
  return prints;
}

bool IsAsItWas(const Json& json) {
  const stages::Fingerprint earlier = stages::PrintFrom(json), now = stages::FingerprintOf(earlier.path, &earlier);
  std::error_code ignored;
  if (now.links) return false;
  if (now.files == 0 && earlier.files == 0) return now.error.empty() || !fs::exists(fs::symlink_status(earlier.path, ignored));
  return now.SameAs(earlier);
}

bool AreAsTheyWere(const Json& prints) { return std::all_of(prints.begin(), prints.end(), IsAsItWas); }

/// The last line of provenance with this key; null: there is none.
Json LastLine(const std::string& file, const std::string& key) {
  std::istringstream lines(ReadFile(file));
  Json last;
  for (std::string text; std::getline(lines, text);) {
    if (text.find(key) == std::string::npos) continue;
    const Json line = Json::parse(text, nullptr, false);
    if (line.is_object() && line.contains("record") && line["record"].value("key", "") == key) last = line;
  }
  return last;
}

/// Of its result file, unless that is of another run by now: then only where it is no output itself.
std::optional<CommandResult> ResultOfRun(const std::string& folder, const Json& line, bool is_output) {
  const std::string file = folder + "/" + ResultName(line.at("command").get<std::string>());
  const int exit = line.at("exit").get<int>();
  Json json = fs::is_regular_file(file) ? Json::parse(ReadFile(file), nullptr, false) : Json();
  const bool same = json.is_object() && json.value("argv", Json()) == line.at("argv") &&
                    json.value("timing", Json::object()).value("wall_s", Json()) == line.at("wall_s");
  if (is_output && !same) return std::nullopt;
  CommandResult result = ResultFromJson(same ? json : Json::object({{"outputs", line.at("outputs")}}), exit);
  result.unchanged_since = line.at("time").get<std::string>();
  result.text = "up to date: nothing changed since " + result.unchanged_since;
  return result;
}

std::optional<CommandResult> ResultBeside(const std::string& folder, const std::string& key, const std::string& path) {
  const Json line = LastLine(folder + "/provenance.jsonl", key);
  if (!line.is_object()) return std::nullopt;
  const Json &reads = line.at("record").at("reads"), &writes = line.at("record").at("writes");
  const bool is_record = path == folder + "/" + ResultName(line.at("command").get<std::string>());
  const bool wrote_it = std::any_of(writes.begin(), writes.end(), [&](const Json& write) {
    const std::string written = write.at("path").get<std::string>();
    return IsAtOrBelow(path, written) || IsAtOrBelow(written, path);
  });
  if ((!wrote_it && !is_record) || !AreAsTheyWere(writes) || !AreAsTheyWere(reads)) return std::nullopt;
  return ResultOfRun(folder, line, is_record);
}

}  // namespace

TypedLine TypedLineOf(const Registry::Entry& entry, const GlobalOptions& global) {
  TypedLine line;
  std::vector<std::string> outputs;
  std::string text =
      entry.name + '\0' + MVSTUDIO_VERSION + '\0' + std::to_string(global.seed) + '\0' + std::to_string(global.threads);
  for (CLI::App* app = entry.app; app->get_parent(); app = app->get_parent()) {
    for (CLI::Option* option : app->get_options([](const CLI::Option*) { return true; })) {
      if (option->count() == 0 || option->get_name() == "--overwrite") continue;
      const bool is_input = !IsOutput(option) && option->get_name() != "--cache";
      text += '\0' + option->get_name();
      for (const std::string& value : option->results()) text += '\0' + ResolvedValue(value, is_input ? &line.named : &outputs);
    }
  }
  line.key = Sha256Hex(text.data(), text.size());
  return line;
}

Json RecordOfLine(const Registry::Entry& entry, const GlobalOptions& global, const CommandResult& result,
                  const DiskTrace& trace, int64_t begun_ns) {
  if (Redacting() || result.folder.empty() || (result.exit != kExitOk && result.exit != kExitPartial)) return nullptr;
  try {
    const TypedLine line = TypedLineOf(entry, global);
    const PathSet inputs = InputsOfLine(entry, line, result, trace);
    PathSet written = trace.published();
    for (auto at = written.begin(); at != written.end();) at = fs::exists(*at) ? std::next(at) : written.erase(at);
    return {
        {"key", line.key}, {"reads", PrintsOf(inputs, written, begun_ns)}, {"writes", PrintsOf(written, written, begun_ns)}};
  } catch (const NotJudged&) {
    return nullptr;
  } catch (const std::exception&) {  // a result is none the worse for it
    return nullptr;
  }
}

std::optional<CommandResult> EarlierResult(const Registry::Entry& entry, const GlobalOptions& global, const std::string& path) {
  constexpr int kMostParents = 3;
  if (Redacting()) return std::nullopt;
  try {
    const TypedLine line = TypedLineOf(entry, global);
    const std::string whole = PathOnDisk(path);
    std::vector<std::string> folders = line.named;  // `avatar render` keeps its result in the run
    fs::path folder = whole;
    for (int up = 0; up < kMostParents; ++up, folder = folder.parent_path()) folders.push_back(folder.string());
    for (const std::string& each : folders) {
      if (!fs::is_regular_file(each + "/provenance.jsonl")) continue;
      if (auto result = ResultBeside(each, line.key, whole)) return result;
    }
  } catch (const std::exception&) {  // no record that can be read
  }
  return std::nullopt;
}

}  // namespace mvstudio::cli
