#include <algorithm>
#include <map>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/compare/compared.h"
#include "report/page/difference.h"

namespace mvstudio::report {
namespace {

const Stage* InFolder(const std::vector<const Stage*>& stages, const std::string& folder) {
  const auto found = std::find_if(stages.begin(), stages.end(), [&](const Stage* s) { return s->folder == folder; });
  return found == stages.end() ? nullptr : *found;
}

/// The command in each run: the one result, or those of each folder.
void AddCommand(const ComparedRuns& runs, const std::string& command, std::vector<ComparedStage>* stages) {
  std::vector<std::vector<const Stage*>> found;
  std::set<std::string> folders;
  bool once = true;
  for (const RunData& run : runs.data) {
    found.push_back(run.All(command));
    once = once && found.back().size() <= 1;
    for (const Stage* stage : found.back()) folders.insert(stage->folder);
  }
  if (once) folders = {""};
  for (const std::string& folder : folders) {
    ComparedStage stage{command, folder, {}, ""};
    for (const auto& of_run : found)
      stage.runs.push_back(once ? of_run.empty() ? nullptr : of_run.front() : InFolder(of_run, folder));
    if (command == "avatar eval" && stage.InBoth()) stage.why_not = WhyScoresDiffer(*stage.runs.front(), *stage.runs.back());
    stages->push_back(std::move(stage));
  }
}

Value ProtocolOf(const Stage& stage) {
  const std::string file = FileOfRun(stage, (stage.folder.empty() ? "" : stage.folder + "/") + "protocol.json", false);
  try {
    return file.empty() ? Value() : Value::Parse(ReadFile(file), file)["protocol"];
  } catch (const Error&) {  // the digests alone then say that they differ
    return {};
  }
}

/// What a field of a protocol is about.
std::string SubjectOf(const std::string& field) {
  static const std::map<std::string, std::string> kSubjects = {
      {"holdout", "other images were held out"},
      {"dataset", "the images, masks, joints or cameras of the dataset differ"},
      {"crop", "the images were cut in another way"},
      {"background", "another background lies behind them"},
      {"features", "another net measured the distance"},
      {"lpips", "another net measured LPIPS"},
      {"metrics", "the scores were computed in another way"}};
  const auto found = kSubjects.find(field.substr(0, field.find('.')));
  return found == kSubjects.end() ? "their protocols differ" : found->second;
}

std::string BriefText(const Value& value) {
  const std::string text = value.IsNull() ? "not there" : value.IsText() ? value.Text() : value.Dump();
  return text.size() > 40 ? "" : text;
}

}  // namespace

std::vector<ComparedStage> MatchStages(const ComparedRuns& runs) {
  std::vector<std::string> commands;
  for (const RunData& run : runs.data) {
    for (const Stage& stage : run.stages) {
      if (std::find(commands.begin(), commands.end(), stage.command) == commands.end()) commands.push_back(stage.command);
    }
  }
  std::stable_sort(commands.begin(), commands.end(),
                   [](const auto& a, const auto& b) { return PipelineOrder(a) < PipelineOrder(b); });
  std::vector<ComparedStage> stages;
  for (const std::string& command : commands) AddCommand(runs, command, &stages);
  return stages;
}

std::string WhyScoresDiffer(const Stage& first, const Stage& last) {
  const std::string a = first.metrics()["protocol_sha256"].Text(), b = last.metrics()["protocol_sha256"].Text();
  if (!a.empty() && a == b) return "";
  if (a.empty() || b.empty()) return "a run does not say on which images it was scored";
  const auto difference = FirstDifference(ProtocolOf(last), ProtocolOf(first));
  if (!difference) return "scored by different protocols";
  const std::string own = BriefText(difference->own), other = BriefText(difference->other);
  const std::string values = own.empty() || other.empty() ? "" : ": " + other + ", then " + own;
  return SubjectOf(difference->field) + " (" + difference->field + values + ")";
}

}  // namespace mvstudio::report
