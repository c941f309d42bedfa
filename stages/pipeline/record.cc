#include "stages/pipeline/record.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
#include "stages/result.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

using StageJson = nlohmann::ordered_json;

constexpr char kRunSchema[] = "mvstudio.run/1";

}  // namespace

StageJson PrintJson(const Fingerprint& print) {
  return {
      {"path", print.path}, {"files", print.files}, {"bytes", print.bytes}, {"stamp", print.stamp}, {"sha256", print.sha256}};
}

Fingerprint PrintFrom(const StageJson& json) {
  Fingerprint print;
  print.path = json.at("path").get<std::string>();
  print.files = json.at("files").get<uint64_t>();
  print.bytes = json.at("bytes").get<uint64_t>();
  print.stamp = json.at("stamp").get<std::string>();
  print.sha256 = json.at("sha256").get<std::string>();
  return print;
}

namespace {

StageJson RecordJson(const std::string& name, const StageRecord& record) {
  StageJson json = {{"stage", name},        {"version", record.version},   {"words", record.words},
                    {"exit", record.exit},  {"accepted", record.accepted}, {"seconds", record.seconds},
                    {"found", record.found}};
  for (const Notice& error : record.errors)
    json["errors"].push_back({{"code", error.code}, {"text", error.text}, {"hint", error.hint}});
  if (!record.told.empty()) json["told"] = record.told;
  json["inputs"] = StageJson::array();
  for (const Fingerprint& input : record.inputs) json["inputs"].push_back(PrintJson(input));
  json["output"] = PrintJson(record.output);
  return json;
}

/// `session`: the folder of a file whose earlier versions named paths as the caller did.
StageRecord RecordFrom(const StageJson& json, const std::string& session) {
  StageRecord record;
  record.version = json.at("version").get<std::string>();
  record.words = json.at("words").get<std::vector<std::string>>();
  record.exit = json.at("exit").get<int>();
  record.accepted = json.at("accepted").get<std::vector<std::string>>();
  record.seconds = json.at("seconds").get<double>();
  record.found = json.at("found").get<bool>();
  for (const StageJson& error : json.value("errors", StageJson::array()))
    record.errors.push_back({error.at("code"), error.at("text"), error.at("hint"), true});
  record.told = json.value("told", std::vector<std::string>());
  for (const StageJson& input : json.at("inputs")) record.inputs.push_back(PrintFrom(input));
  record.output = PrintFrom(json.at("output"));
  for (std::string& word : record.words) word = InSession(word, session);
  for (Fingerprint& input : record.inputs) input.path = InSession(input.path, session);
  record.output.path = InSession(record.output.path, session);
  return record;
}

/// Time of the last change of a file, or of the latest one below a folder; the least time for nothing.
fs::file_time_type LatestChange(const std::string& path) {
  fs::file_time_type latest = fs::file_time_type::min();
  std::error_code none;
  const auto see = [&](const fs::path& file) {
    const fs::file_time_type time = fs::last_write_time(file, none);
    if (!none) latest = std::max(latest, time);
  };
  if (IsPattern(path)) {
    for (const std::string& file : FilesMatching(path)) see(file);
  } else if (!fs::is_directory(path, none)) {
    see(path);
  } else {
    for (fs::recursive_directory_iterator at(path, none), end; !none && at != end; at.increment(none)) {
      if (at->is_regular_file(none) && at->path().filename().string()[0] != '.') see(at->path());
    }
  }
  return latest;
}

/// What was added to one command line and taken from another.
std::string ChangedWords(const std::vector<std::string>& before, const std::vector<std::string>& now) {
  std::vector<std::string> gone, added;
  for (const std::string& word : before)
    if (std::find(now.begin(), now.end(), word) == now.end()) gone.push_back(word);
  for (const std::string& word : now)
    if (std::find(before.begin(), before.end(), word) == before.end()) added.push_back(word);
  return "other flags: " + (gone.empty() ? std::string("none") : Join(gone, " ")) + " -> " +
         (added.empty() ? std::string("none") : Join(added, " "));
}

const Fingerprint* FindPrint(const std::vector<Fingerprint>& prints, const std::string& path) {
  const auto found = std::find_if(prints.begin(), prints.end(), [&](const Fingerprint& print) { return print.path == path; });
  return found == prints.end() ? nullptr : &*found;
}

/// The first inputs that are not what they were.
std::string ChangedInputs(const std::vector<Fingerprint>& before, const std::vector<Fingerprint>& now) {
  std::vector<std::string> changes;
  for (const Fingerprint& input : now) {
    const Fingerprint* earlier = FindPrint(before, input.path);
    if (!earlier || earlier->files == 0) {
      if (input.files > 0) changes.push_back(input.path + " is new");
    } else if (input.files == 0) {
      changes.push_back(input.path + " is gone");
    } else if (!input.SameAs(*earlier)) {
      changes.push_back(input.path + " changed");
    }
  }
  const size_t others = changes.size() > 2 ? changes.size() - 2 : 0;
  changes.resize(changes.size() - others);
  return Join(changes, ", ") + (others ? " and " + std::to_string(others) + " more" : "");
}

}  // namespace

bool IsSameOutput(const Fingerprint& now, const StageRecord& record) {
  return (now.files == 0 && record.output.files == 0) || now.SameAs(record.output);
}

bool IsSettled(const PipelineStage& stage, const StageRecord& record) {
  if (record.exit == kExitOk || record.exit == kExitPartial || !record.accepted.empty()) return true;
  return stage.may_fail && (record.exit == kExitQualityGate || record.exit == kExitIllPosed);
}

StageRecords ReadStageRecords(const std::string& path) {
  StageRecords records;
  if (!fs::exists(path)) return records;
  const std::string session = fs::path(path).parent_path().string();
  try {
    const StageJson json = StageJson::parse(ReadFile(path));
    if (json.at("schema") != kRunSchema) throw FormatError(path, "schema", std::string("must be \"") + kRunSchema + "\"");
    for (const StageJson& stage : json.at("stages")) records[stage.at("stage").get<std::string>()] = RecordFrom(stage, session);
  } catch (const StageJson::exception& e) {
    throw FormatError(path, "", std::string("is no record of `mvstudio run`: ") + e.what() + "; remove it to begin anew");
  }
  return records;
}

void WriteStageRecords(const std::string& path, const StageRecords& records) {
  StageJson json = {{"schema", kRunSchema}, {"stages", StageJson::array()}};
  for (const auto& [name, record] : records) json["stages"].push_back(RecordJson(name, record));
  WriteFileAtomic(path, json.dump(1, ' ', false, StageJson::error_handler_t::replace) + "\n");
}

std::string InSession(const std::string& path, const std::string& session) {
  if (session.empty()) return path;
  if (path == session) return ".";
  const std::string folder = session.back() == '/' ? session : session + "/";
  if (path.rfind(folder, 0) != 0) return path;
  return path.substr(std::min(path.find_first_not_of('/', folder.size()), path.size()));
}

namespace {

/// The command line as records keep it, options by their names.
std::vector<std::string> WordsOf(const PipelineStage& stage) {
  std::vector<std::string> words;
  const auto add = [&](const std::string& word) { words.push_back(InSession(word, stage.session)); };
  for (const std::string& word : stage.command) add(word);
  for (const LineOption& option : stage.options) {
    if (option.values.empty()) words.push_back(option.name);
    for (const std::string& value : option.values) words.push_back(option.name), add(value);
  }
  return words;
}

}  // namespace

std::vector<std::string> FailuresIn(const StageRecords& records) {
  std::vector<std::string> failures;
  for (const auto& [name, record] : records)
    for (const Notice& error : record.errors) failures.push_back(name + ": " + error.code + " " + error.text);
  return failures;
}

StageRecord RecordOf(const PipelineStage& stage, const std::string& version, const StageRecord* earlier) {
  StageRecord record;
  record.version = version;
  record.words = WordsOf(stage);
  const auto print = [&](const std::string& path, const Fingerprint* before) {
    Fingerprint now = FingerprintOf(path, before);
    now.path = InSession(path, stage.session);
    return now;
  };
  for (const std::string& input : stage.inputs)
    record.inputs.push_back(print(input, earlier ? FindPrint(earlier->inputs, InSession(input, stage.session)) : nullptr));
  record.output = print(stage.output, earlier ? &earlier->output : nullptr);
  return record;
}

std::string WhyStale(const PipelineStage& stage, const StageRecord& now, const StageRecord* earlier) {
  if (!earlier) return "not done yet";
  if (earlier->exit == kBegun) return "was interrupted";
  if (!IsSettled(stage, *earlier)) return "ended with exit code " + std::to_string(earlier->exit);
  if (earlier->version != now.version) return "done by version " + earlier->version;
  if (earlier->words != now.words) return ChangedWords(earlier->words, now.words);
  const std::string inputs = ChangedInputs(earlier->inputs, now.inputs);
  if (!inputs.empty()) return inputs;
  if (earlier->told != now.told) return "it does not tell what failed since";
  if (now.output.files == 0 && earlier->output.files > 0) return stage.output + " is gone";
  return "";
}

bool IsNewerThanInputs(const PipelineStage& stage) {
  const fs::file_time_type output = LatestChange(stage.output);
  if (output == fs::file_time_type::min()) return false;
  return std::all_of(stage.inputs.begin(), stage.inputs.end(),
                     [&](const std::string& input) { return LatestChange(input) <= output; });
}

Judgement JudgeStage(const PipelineStage& stage, const std::string& version, const StageRecord* earlier,
                     const std::vector<std::string>& failures) {
  Judgement judged;
  judged.now = RecordOf(stage, version, earlier);
  if (stage.kind == StageKind::kReport) judged.now.told = failures;
  judged.stale = WhyStale(stage, judged.now, earlier);
  // A report that others made need not tell of failures: they are in run.json, which is none of its inputs.
  judged.now.found = !earlier && judged.now.told.empty() && IsNewerThanInputs(stage);
  if (judged.now.found) judged.stale = "found, newer than what it is made of";
  return judged;
}

double SecondsOf(const StageRecord* earlier) {
  return earlier && !earlier->found && earlier->exit != kBegun ? earlier->seconds : NAN;
}

}  // namespace mvstudio::stages
