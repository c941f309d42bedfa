#include "stages/study/avatar_scores.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <tuple>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "report/page/difference.h"
#include "stages/dataset/studio_names.h"

namespace mvstudio::stages {
namespace {

using report::Value;

constexpr char kSchema[] = "mvstudio.avatar-protocol/1";

/// Keys sorted, no blanks: what the digest is of.
std::string Canonical(const Value& value) { return nlohmann::json::parse(value.Dump()).dump(); }

Value ReadJson(const std::string& path, const char* advice) {
  if (!std::filesystem::exists(path)) throw IoError(path, std::string("is missing; ") + advice);
  return Value::Parse(ReadFile(path), path);
}

/// What a value says, in the studio's names of its cameras.
std::string Brief(const Value& value, const ScoreProtocol& of) {
  const std::string said = value.IsNull() ? "not there" : value.IsText() ? value.Text() : value.Dump();
  const std::string text = WithNames(said, of.studio_names);
  return text.size() > 60 ? text.substr(0, 57) + "..." : text;
}

std::string Told(const report::ValueDifference& difference, const ScoreProtocol& own, const ScoreProtocol& first) {
  return "is " + Brief(difference.own, own) + ", in " + first.path + " it is " + Brief(difference.other, first);
}

/// By the dataset of the run, as long as it is where it was.
std::map<std::string, std::string> NamesOfRun(const std::string& run_folder) {
  const std::string path = run_folder + "/config.json";
  try {
    return StudioNames(Value::Parse(ReadFile(path), path)["dataset"].Text());
  } catch (const Error&) {  // scores do not need it
    return {};
  }
}

}  // namespace

ScoreProtocol ReadScoreProtocol(const std::string& run_folder) {
  ScoreProtocol protocol;
  protocol.path = run_folder + "/protocol.json";
  const Value json = ReadJson(protocol.path, "score the run with `mvstudio avatar eval`, which writes it");
  if (json["schema"].Text() != kSchema) throw FormatError(protocol.path, "schema", std::string("is not ") + kSchema);
  protocol.sha256 = json["sha256"].Text();
  protocol.body = json["protocol"];
  protocol.splits = json["splits"];
  if (!protocol.body.IsObject()) throw FormatError(protocol.path, "protocol", "is missing");
  const std::string canonical = Canonical(protocol.body);
  if (Sha256Hex(canonical.data(), canonical.size()) != protocol.sha256)
    throw FormatError(protocol.path, "sha256", "does not fit the protocol; was the file edited? score the run again");
  protocol.studio_names = NamesOfRun(run_folder);
  return protocol;
}

std::string FirstDifference(const ScoreProtocol& own, const ScoreProtocol& first) {
  const auto difference = report::FirstDifference(own.body, first.body);
  return difference ? difference->field + " " + Told(*difference, own, first) : "";
}

void RequireSameProtocol(const ScoreProtocol& own, const ScoreProtocol& first) {
  const auto difference = report::FirstDifference(own.body, first.body);
  if (!difference) return;
  throw FormatError(own.path, difference->field,
                    Told(*difference, own, first) +
                        ": scores of different protocols cannot be compared; score both with the same `avatar eval` options");
}

std::pair<std::string, std::string> SplitLabel(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || std::filesystem::is_directory(text)) return {"", text};
  return {text.substr(0, equals), text.substr(equals + 1)};
}

ScoredRun ReadScoredRun(const std::string& text) {
  ScoredRun run;
  std::tie(run.label, run.folder) = SplitLabel(text);
  while (run.folder.size() > 1 && run.folder.back() == '/') run.folder.pop_back();
  RequireFolder(run.folder, "; give the option 'out' folders of `mvstudio avatar train`");
  const std::string path = run.folder + "/avatar_eval.result.json";
  const Value eval = ReadJson(path, "score the run with `mvstudio avatar eval`");
  run.metrics = eval["metrics"], run.timing = eval["timing"];
  if (!run.metrics["holdout"]["ssim"].IsNumber()) throw FormatError(path, "metrics.holdout.ssim", "is missing");
  run.protocol = ReadScoreProtocol(run.folder);
  if (run.metrics["protocol_sha256"].Text() != run.protocol.sha256)
    throw FormatError(path, "metrics.protocol_sha256", "is not that of " + run.protocol.path + "; score the run again");
  const std::string train = run.folder + "/avatar_train.result.json";
  if (std::filesystem::exists(train)) run.train = ReadJson(train, "");
  return run;
}

}  // namespace mvstudio::stages
