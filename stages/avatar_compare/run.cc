#include "stages/avatar_compare/run.h"

#include <filesystem>
#include <map>
#include <set>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "report/study/study_tally.h"
#include "stages/study/avatar_scores.h"

namespace mvstudio::stages {
namespace {

std::vector<ScoredRun> ReadScoredRuns(const std::vector<std::string>& texts) {
  std::vector<ScoredRun> runs;
  std::set<std::filesystem::path> folders;
  for (const std::string& text : texts) {
    runs.push_back(ReadScoredRun(text));
    RequireSameProtocol(runs.back().protocol, runs.front().protocol);
    if (!folders.insert(std::filesystem::weakly_canonical(runs.back().folder)).second)
      throw UsageError(runs.back().folder + " is given twice: a run counts once in the spread of its row");
  }
  return runs;
}

/// Rows that differ cannot bear one name: a table of them could not be read.
void RequireOwnNames(const Comparison& comparison) {
  std::map<std::string, std::string> folders;
  for (const ComparisonRow& row : comparison.rows) {
    if (row.baseline || row.folders.empty()) continue;
    const auto [at, is_new] = folders.emplace(row.name, row.folders.front());
    if (!is_new)
      throw UsageError(at->second + " and " + row.folders.front() + " differ and are both called '" + row.name +
                       "': give each its own NAME=RUN");
  }
}

/// Runs of one seed in one row are no samples of what the seed changes.
}  // namespace

AvatarCompareReport RunAvatarCompare(const AvatarCompareOptions& options) {
  const std::vector<ScoredRun> runs = ReadScoredRuns(options.runs);
  AvatarCompareReport report{options, CompareRuns(runs, options.baselines), runs.front().protocol.sha256, {}};
  RequireOwnNames(report.comparison);
  if (!options.study.empty()) {
    std::vector<report::StudyAnswers> answers;
    for (const std::string& path : options.study) answers.push_back(report::ReadStudyAnswers(path));
    report.not_judged = AddStudies(answers, &report.comparison);
  }
  if (!options.out.empty()) {
    const OutputFiles place({options.out}, {});
    WriteFileAtomic(options.out, MarkdownTable(report.comparison));
  }
  return report;
}

}  // namespace mvstudio::stages
