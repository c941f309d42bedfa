#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "report/page/format.h"
#include "report/study/study_tally.h"
#include "stages/study/avatar_scores.h"
#include "stages/study/avatar_table.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::vector<std::string> runs, study;
  std::string out;
  bool baselines = true;
};

ordered_json SpreadJson(const stages::Spread& spread) {
  return {{"mean", FiniteOrNull(spread.mean)},
          {"half_range", FiniteOrNull(spread.half_range)},
          {"sd", FiniteOrNull(spread.sd)},
          {"n", spread.n}};
}

ordered_json ShareJson(const stages::StudyCell& cell) {
  return {{"against", cell.against}, {"share", cell.share},  {"ci95", {cell.low, cell.high}}, {"n", cell.n},
          {"p_value", cell.p_value}, {"raters", cell.raters}};
}

ordered_json RowJson(const stages::ComparisonRow& row) {
  ordered_json json = {{"name", row.name}, {"method", row.method}, {"num_runs", row.folders.size()}};
  json["seeds"] = row.seeds;
  json["cameras"] = row.cameras;
  json["splits"] = ordered_json::object();
  for (const auto& [kind, scores] : row.splits) {
    for (const auto& [key, spread] : scores.values) json["splits"][kind][key] = SpreadJson(spread);
    json["splits"][kind]["same_pictures"] = scores.same_pictures;
  }
  json["costs"] = ordered_json::object();
  for (const auto& [key, spread] : row.costs) json["costs"][key] = SpreadJson(spread);
  if (!row.study.empty()) json["study"] = ordered_json::array();
  for (const stages::StudyCell& cell : row.study) json["study"].push_back(ShareJson(cell));
  json["runs"] = row.folders;
  return json;
}

std::vector<stages::ScoredRun> ReadRuns(const std::vector<std::string>& texts) {
  std::vector<stages::ScoredRun> runs;
  std::set<std::filesystem::path> folders;
  for (const std::string& text : texts) {
    runs.push_back(stages::ReadScoredRun(text));
    stages::RequireSameProtocol(runs.back().protocol, runs.front().protocol);
    if (!folders.insert(std::filesystem::weakly_canonical(runs.back().folder)).second)
      throw UsageError(runs.back().folder + " is given twice: a run counts once in the spread of its row");
  }
  return runs;
}

/// Rows that differ cannot bear one name: a table of them could not be read.
void RequireOwnNames(const stages::Comparison& comparison) {
  std::map<std::string, std::string> folders;
  for (const stages::ComparisonRow& row : comparison.rows) {
    if (row.baseline || row.folders.empty()) continue;
    const auto [at, is_new] = folders.emplace(row.name, row.folders.front());
    if (!is_new)
      throw UsageError(at->second + " and " + row.folders.front() + " differ and are both called '" + row.name +
                       "': give each its own NAME=RUN");
  }
}

/// Runs of one seed in one row are no samples of what the seed changes.
std::vector<Notice> RepeatedSeeds(const stages::Comparison& comparison) {
  std::vector<Notice> notices;
  for (const stages::ComparisonRow& row : comparison.rows) {
    std::set<std::string> seeds;
    for (const std::string& seed : row.seeds) {
      if (seeds.insert(seed).second) continue;
      notices.push_back({"CMP-SEED", "'" + row.name + "' has several runs of seed " + seed + ": its spread is too small",
                         "train with other --seed, or name what differs: NAME=RUN"});
      break;
    }
  }
  return notices;
}

CommandResult Run(const Arguments& arguments) {
  const std::vector<stages::ScoredRun> runs = ReadRuns(arguments.runs);
  stages::Comparison comparison = stages::CompareRuns(runs, arguments.baselines);
  CommandResult result;
  RequireOwnNames(comparison);
  result.warnings = RepeatedSeeds(comparison);
  if (!arguments.study.empty()) {
    std::vector<report::StudyAnswers> answers;
    for (const std::string& path : arguments.study) answers.push_back(report::ReadStudyAnswers(path));
    for (const std::string& name : stages::AddStudies(answers, &comparison)) {
      result.warnings.push_back(
          {"CMP-STUDY", "no row is called '" + name + "', which the answers judge", "name the run: '" + name + "=RUN'"});
    }
  }
  for (const std::string& kind : comparison.mixed_splits) {
    result.warnings.push_back({"CMP-SPLIT", "'" + kind + "' is not of the same images in all runs",
                               "compare there only rows with the same training cameras"});
  }
  result.metrics["protocol_sha256"] = runs.front().protocol.sha256;
  result.metrics["distance"] = comparison.distance_name;
  result.metrics["rows"] = ordered_json::array();
  for (const stages::ComparisonRow& row : comparison.rows) result.metrics["rows"].push_back(RowJson(row));
  result.metrics["differences"] = ordered_json::array();
  for (const stages::RowDifference& d : comparison.differences)
    result.metrics["differences"].push_back(
        {{"row", d.row},
         {"against", d.against},
         {"ssim", d.ssim},
         {"outside_spread", d.spread_known ? ordered_json(d.outside_spread) : ordered_json()}});
  result.text = stages::TextTable(comparison);
  result.inputs = {};
  if (!arguments.out.empty()) {
    const OutputFiles place({arguments.out}, {});
    WriteFileAtomic(arguments.out, stages::MarkdownTable(comparison));
    result.outputs.push_back({arguments.out, "table"});
  }
  return result;
}

}  // namespace

void RegisterAvatarCompare(CLI::App& avatar, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = avatar.add_subcommand(
      "compare", "Table of scored runs, methods x splits, as in Table 1 of the paper; runs of one method are its seeds");
  AddOption(sub, "run", arguments->runs, "folders of runs that `avatar eval` has scored; NAME=RUN gives the row's name")
      ->required();
  AddOption(sub, "--study", arguments->study, "answers to user studies between rows (mvstudio report --study)");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFile, "also write the table as Markdown");
  AddFlag(sub, "--baselines,!--no-baselines", arguments->baselines,
          "rows of the fitted body, the mean image and the nearest view");
  registry.Add(sub, "avatar compare", [arguments](CommandContext&) { return Run(*arguments); });
}

}  // namespace mvstudio::cli
