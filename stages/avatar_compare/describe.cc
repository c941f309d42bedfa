#include "stages/avatar_compare/describe.h"

#include <set>

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json SpreadJson(const Spread& spread) {
  return {{"mean", FiniteOrNull(spread.mean)},
          {"half_range", FiniteOrNull(spread.half_range)},
          {"sd", FiniteOrNull(spread.sd)},
          {"n", spread.n}};
}

ordered_json StudyShareJson(const StudyCell& cell) {
  return {{"against", cell.against}, {"share", cell.share},  {"ci95", {cell.low, cell.high}}, {"n", cell.n},
          {"p_value", cell.p_value}, {"raters", cell.raters}};
}

ordered_json ComparisonRowJson(const ComparisonRow& row) {
  ordered_json json = {{"name", row.name}, {"method", row.method}, {"num_runs", row.folders.size()}};
  json["seeds"] = row.seeds;
  json["cameras"] = row.cameras;
  json["splits"] = ordered_json::object();
  for (const auto& [kind, scores] : row.splits) {
    for (const auto& [key, spread] : scores.values) json["splits"][kind][key] = SpreadJson(spread);
    json["splits"][kind]["same_pictures"] = scores.same_images;
  }
  json["costs"] = ordered_json::object();
  for (const auto& [key, spread] : row.costs) json["costs"][key] = SpreadJson(spread);
  if (!row.study.empty()) json["study"] = ordered_json::array();
  for (const StudyCell& cell : row.study) json["study"].push_back(StudyShareJson(cell));
  json["runs"] = row.folders;
  return json;
}

/// Runs of one seed in one row are no samples of what the seed changes.
std::vector<Notice> RepeatedSeeds(const Comparison& comparison) {
  std::vector<Notice> notices;
  for (const ComparisonRow& row : comparison.rows) {
    std::set<std::string> seeds;
    for (const std::string& seed : row.seeds) {
      if (seeds.insert(seed).second) continue;
      notices.push_back({"CMP-SEED", "'" + row.name + "' has several runs of seed " + seed + ": its spread is too small",
                         "train with other option 'seed', or name what differs: NAME=RUN"});
      break;
    }
  }
  return notices;
}

}  // namespace

CommandResult Describe(const AvatarCompareReport& report) {
  const Comparison& comparison = report.comparison;
  CommandResult result;
  result.warnings = RepeatedSeeds(comparison);
  for (const std::string& name : report.not_judged) {
    result.warnings.push_back(
        {"CMP-STUDY", "no row is called '" + name + "', which the answers judge", "name the run: '" + name + "=RUN'"});
  }
  for (const std::string& kind : comparison.mixed_splits) {
    result.warnings.push_back({"CMP-SPLIT", "'" + kind + "' is not of the same images in all runs",
                               "compare there only rows with the same training cameras"});
  }
  result.metrics["protocol_sha256"] = report.protocol_sha256;
  result.metrics["distance"] = comparison.distance_name;
  result.metrics["rows"] = ordered_json::array();
  for (const ComparisonRow& row : comparison.rows) result.metrics["rows"].push_back(ComparisonRowJson(row));
  result.metrics["differences"] = ordered_json::array();
  for (const RowDifference& d : comparison.differences)
    result.metrics["differences"].push_back(
        {{"row", d.row},
         {"against", d.against},
         {"ssim", d.ssim},
         {"outside_spread", d.spread_known ? ordered_json(d.outside_spread) : ordered_json()}});
  result.text = TextTable(comparison);
  if (!report.options.out.empty()) result.outputs.push_back({report.options.out, "table"});
  return result;
}

}  // namespace mvstudio::stages
