#include "app/study/avatar_table.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <tuple>

#include "core/join.h"
#include "core/statistics.h"
#include "report/page/format.h"

namespace mvstudio::app {
namespace {

using report::Value;

constexpr char kScoreKeys[][12] = {"ssim", "psnr_db", "mask_iou", "boundary_f", "lpips", "flicker"};
/// Options that change no number of a result.
constexpr char kSilentOptions[][24] = {
    "seed",        "train.device", "train.save-every", "train.report-every", "train.validate-pictures", "train.picture-every",
    "model.method"};

const std::map<std::string, std::string> kMethodNames = {{"tna", "TNA"}, {"direct", "Direct"}, {"v2v", "V2V-lite"}};

using Options = std::map<std::string, std::string>;

/// What a run was trained with, but for its seed.
struct Recipe {
  std::string label, method;
  std::vector<std::string> cameras;
  Options options;
  bool operator<(const Recipe& o) const {
    return std::tie(label, method, cameras, options) < std::tie(o.label, o.method, o.cameras, o.options);
  }
};

Recipe RecipeOf(const ScoredRun& run) {
  Recipe recipe;
  const Value& training = run.metrics["training"];
  recipe.method = training["options"]["model.method"].Text("unknown");
  for (const Value& camera : training["cameras"].items()) recipe.cameras.push_back(camera.Text());
  recipe.label = run.label;
  if (!run.label.empty()) return recipe;
  for (const auto& [key, value] : training["options"].fields()) recipe.options[key] = value.Text();
  recipe.options["size"] = training["size_px"].Dump();
  for (const char* key : kSilentOptions) recipe.options.erase(key);
  return recipe;
}

/// "3 cameras, width 8": what tells this recipe from the others of its method.
std::string Distinction(const Recipe& own, const std::vector<Recipe>& others) {
  std::set<std::string> different;
  bool cameras = false, counts = false;
  for (const Recipe& other : others) {
    if (other.method != own.method || !other.label.empty()) continue;
    cameras = cameras || other.cameras != own.cameras;
    counts = counts || other.cameras.size() != own.cameras.size();
    for (const Recipe* one : {&own, &other}) {
      for (const auto& [key, value] : one->options) {
        const auto a = own.options.find(key), b = other.options.find(key);
        if (a == own.options.end() || b == other.options.end() || a->second != b->second) different.insert(key);
      }
    }
  }
  std::string text;
  const auto add = [&text](const std::string& part) { text += ", " + part; };
  if (counts) add(std::to_string(own.cameras.size()) + " cameras");
  if (cameras && !counts) add("cameras " + Join(own.cameras, "+"));
  for (const std::string& key : different) {
    const auto found = own.options.find(key);
    add(key.substr(key.find('.') + 1) + " " + (found == own.options.end() ? "-" : found->second));
  }
  return text;
}

std::map<std::string, double> ScoresOf(const Value& scored) {
  std::map<std::string, double> scores;
  for (const char* key : kScoreKeys) {
    if (scored[key].IsNumber()) scores[key] = scored[key].Number();
  }
  if (scored["fd"]["value"].IsNumber()) scores["fd"] = scored["fd"]["value"].Number();
  return scores;
}

using ValuesBySplit = std::map<std::string, std::map<std::string, std::vector<double>>>;

void Collect(const std::string& kind, const Value& scored, ValuesBySplit* values) {
  for (const auto& [key, value] : ScoresOf(scored)) (*values)[kind][key].push_back(value);
}

ComparisonRow RowOf(const std::vector<const ScoredRun*>& runs, const ScoredRun& first, const std::string& primary) {
  ComparisonRow row;
  ValuesBySplit values;
  std::set<std::string> mixed;
  for (const ScoredRun* run : runs) {
    row.folders.push_back(run->folder);
    row.seeds.push_back(run->metrics["training"]["options"]["seed"].Text("?"));
    Collect(primary, run->metrics["holdout"], &values);
    for (const auto& [kind, scored] : run->metrics["other_splits"].fields()) {
      Collect(kind, scored, &values);
      if (run->protocol.splits[kind]["sha256"].Text() != first.protocol.splits[kind]["sha256"].Text()) mixed.insert(kind);
    }
  }
  for (const auto& [kind, keys] : values) {
    for (const auto& [key, list] : keys) row.splits[kind].values[key] = SpreadOf(list);
    row.splits[kind].same_pictures = !mixed.count(kind);
  }
  return row;
}

void AddBaselines(const std::vector<ScoredRun>& runs, Comparison* comparison) {
  std::map<std::vector<std::string>, const ScoredRun*> by_cameras;
  for (const ScoredRun& run : runs) by_cameras.emplace(RecipeOf(run).cameras, &run);
  for (const auto& [key, name] :
       {std::pair<std::string, std::string>{"mean_image", "mean image"}, {"nearest_pose", "nearest view"}}) {
    for (const auto& [cameras, run] : by_cameras) {
      const Value& scored = run->metrics["baselines"][key];
      if (!scored["ssim"].IsNumber()) continue;
      ComparisonRow row;
      row.name = name + (by_cameras.size() > 1 ? ", " + std::to_string(cameras.size()) + " cameras" : "");
      row.method = key, row.cameras = cameras, row.baseline = true;
      for (const auto& [score, value] : ScoresOf(scored)) row.splits[comparison->primary].values[score] = SpreadOf({value});
      comparison->rows.push_back(row);
    }
  }
}

void AddDifferences(Comparison* comparison) {
  const auto ssim_of = [&](const ComparisonRow& row) { return row.splits.at(comparison->primary).values.at("ssim"); };
  for (size_t i = 1; i < comparison->rows.size(); ++i) {
    if (comparison->rows[i].baseline) continue;
    const Spread own = ssim_of(comparison->rows[0]), other = ssim_of(comparison->rows[i]);
    const bool known = own.n > 1 && other.n > 1;
    comparison->differences.push_back({comparison->rows[0].name, comparison->rows[i].name, own.mean - other.mean, known,
                                       known && (own.least > other.most || other.least > own.most)});
  }
}

ComparisonRow* FindRow(const std::string& method, Comparison* comparison) {
  for (ComparisonRow& row : comparison->rows) {
    if (row.name == method || row.method == method) return &row;
    for (const std::string& folder : row.folders) {
      if (std::filesystem::path(folder).filename() == method) return &row;
    }
  }
  return nullptr;
}

// ---- text

using Lines = std::vector<std::vector<std::string>>;

std::string Number(const Spread& spread, int decimals) {
  if (spread.n == 0) return report::kNoNumber;
  const std::string mean = report::FormatFixed(spread.mean, decimals);
  return spread.n > 1 ? mean + " \u00b1 " + report::FormatFixed(spread.half_range, decimals) : mean;
}

std::string Cell(const ComparisonRow& row, const std::string& kind, const std::string& key, int decimals) {
  const auto split = row.splits.find(kind);
  if (split == row.splits.end() || !split->second.values.count(key)) return report::kNoNumber;
  return Number(split->second.values.at(key), decimals) + (split->second.same_pictures ? "" : " \u2020");
}

std::string StudyText(const std::vector<StudyCell>& cells) {
  std::string text;
  for (const StudyCell& cell : cells) {
    text += (text.empty() ? "" : "; ") + report::FormatFixed(100 * cell.share, 0) + " % against " + cell.against + " [" +
            report::FormatFixed(100 * cell.low, 0) + ", " + report::FormatFixed(100 * cell.high, 0) + "]";
  }
  return text.empty() ? report::kNoNumber : text;
}

/// A column of one split; `name` in words.
struct Column {
  std::string kind, key, name;
  int decimals;
};

std::vector<Column> Columns(const Comparison& comparison) {
  static const std::pair<const char*, const char*> kKinds[] = {{"held-out cameras in training frames", "cameras held out"},
                                                               {"training cameras in held-out frames", "motion held out"},
                                                               {"held-out cameras in held-out frames", "both held out"}};
  const auto has = [&](const std::string& kind, const std::string& key) {
    return std::any_of(comparison.rows.begin(), comparison.rows.end(), [&](const ComparisonRow& row) {
      return row.splits.count(kind) && row.splits.at(kind).values.count(key);
    });
  };
  std::vector<Column> columns;
  for (const auto& [kind, name] : kKinds) {
    const std::vector<Column> of_split = {{kind, "ssim", std::string(name) + ": SSIM", 4},
                                          {kind, "fd", comparison.distance_name, 2},
                                          {kind, "psnr_db", "PSNR, dB", 2},
                                          {kind, "mask_iou", "mask IoU", 3},
                                          {kind, "lpips", "LPIPS", 3}};
    for (size_t i = 0; i < of_split.size(); ++i) {
      if (has(kind, of_split[i].key) && (i < 2 || kind == comparison.primary)) columns.push_back(of_split[i]);
    }
  }
  return columns;
}

Lines Cells(const Comparison& comparison) {
  const std::vector<Column> columns = Columns(comparison);
  const bool study =
      std::any_of(comparison.rows.begin(), comparison.rows.end(), [](const auto& r) { return !r.study.empty(); });
  Lines lines = {{"method", "runs"}};
  for (const Column& column : columns) lines[0].push_back(column.name);
  if (study) lines[0].push_back("preferred by raters");
  for (const ComparisonRow& row : comparison.rows) {
    std::vector<std::string> line = {row.name, row.baseline ? report::kNoNumber : std::to_string(row.folders.size())};
    for (const Column& column : columns) line.push_back(Cell(row, column.kind, column.key, column.decimals));
    if (study) line.push_back(StudyText(row.study));
    lines.push_back(line);
  }
  return lines;
}

std::string Notes(const Comparison& comparison) {
  std::string text = "Mean ± half the range over the runs of a row.";
  if (!comparison.mixed_splits.empty())
    text += " † not the images of the first run: compare within one set of training cameras.";
  for (const RowDifference& d : comparison.differences) {
    text += "\n" + d.row + " - " + d.against + ": SSIM " + (d.ssim < 0 ? "" : "+") + report::FormatFixed(d.ssim, 4) +
            (!d.spread_known    ? ", the spread is not known: several seeds of each are needed"
             : d.outside_spread ? ", outside the spread of the runs"
                                : ", NOT outside the spread of the runs");
  }
  return text;
}

size_t Width(const std::string& text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

}  // namespace

Spread SpreadOf(const std::vector<double>& values) {
  const std::vector<double> finite = FiniteValues(values);
  Spread spread;
  spread.n = static_cast<int>(finite.size());
  spread.mean = spread.half_range = spread.sd = spread.least = spread.most = std::nan("");
  if (finite.empty()) return spread;
  const auto [low, high] = std::minmax_element(finite.begin(), finite.end());
  spread.least = *low, spread.most = *high, spread.half_range = (*high - *low) / 2;
  spread.mean = Mean(finite), spread.sd = SampleDeviation(finite);
  return spread;
}

Comparison CompareRuns(const std::vector<ScoredRun>& runs, bool baselines) {
  Comparison comparison;
  const ScoredRun& first = runs.front();
  comparison.primary = first.metrics["holdout"]["kind"].Text();
  comparison.distance_name = first.metrics["holdout"]["fd"]["name"].Text("FD");
  std::vector<Recipe> recipes;
  std::map<Recipe, std::vector<const ScoredRun*>> groups;
  for (const ScoredRun& run : runs) {
    const Recipe recipe = RecipeOf(run);
    if (!groups.count(recipe)) recipes.push_back(recipe);
    groups[recipe].push_back(&run);
  }
  std::set<std::string> mixed;
  for (const Recipe& recipe : recipes) {
    ComparisonRow row = RowOf(groups[recipe], first, comparison.primary);
    row.method = recipe.method, row.cameras = recipe.cameras;
    const auto known = kMethodNames.find(recipe.method);
    row.name = !recipe.label.empty()
                   ? recipe.label
                   : (known == kMethodNames.end() ? recipe.method : known->second) + Distinction(recipe, recipes);
    for (const auto& [kind, scores] : row.splits) {
      if (!scores.same_pictures) mixed.insert(kind);
    }
    comparison.rows.push_back(row);
  }
  comparison.mixed_splits.assign(mixed.begin(), mixed.end());
  AddDifferences(&comparison);
  if (baselines) AddBaselines(runs, &comparison);
  return comparison;
}

std::vector<std::string> AddStudies(const std::vector<report::StudyAnswers>& answers, Comparison* comparison) {
  std::map<std::string, std::vector<report::StudyAnswers>> by_study;
  for (const report::StudyAnswers& file : answers) by_study[file.study].push_back(file);
  std::vector<std::string> unknown;
  for (const auto& [study, files] : by_study) {
    const report::StudyTally tally = report::TallyStudy(files);
    const report::StudyShare& all = tally.pooled;
    const auto raters = static_cast<int64_t>(tally.raters.size());
    const auto interval = report::WilsonInterval(all.n - all.chose_a, all.n);
    ComparisonRow *a = FindRow(tally.methods[0], comparison), *b = FindRow(tally.methods[1], comparison);
    if (a) a->study.push_back({b ? b->name : tally.methods[1], all.share_a, all.low, all.high, all.p_value, all.n, raters});
    if (b)
      b->study.push_back(
          {a ? a->name : tally.methods[0], 1 - all.share_a, interval[0], interval[1], all.p_value, all.n, raters});
    if (!a) unknown.push_back(tally.methods[0]);
    if (!b) unknown.push_back(tally.methods[1]);
  }
  return unknown;
}

std::string TextTable(const Comparison& comparison) {
  const Lines lines = Cells(comparison);
  std::vector<size_t> widths(lines[0].size(), 0);
  for (const auto& line : lines) {
    for (size_t c = 0; c < line.size(); ++c) widths[c] = std::max(widths[c], Width(line[c]));
  }
  std::string text;
  for (const auto& line : lines) {
    for (size_t c = 0; c < line.size(); ++c) {
      const std::string gap(widths[c] - Width(line[c]), ' ');
      text += c == 0 ? line[c] + gap : "  " + gap + line[c];
    }
    text += "\n";
  }
  return text + Notes(comparison) + "\n";
}

std::string MarkdownTable(const Comparison& comparison) {
  const Lines lines = Cells(comparison);
  std::string text;
  for (size_t i = 0; i < lines.size(); ++i) {
    text += "|";
    for (const std::string& cell : lines[i]) text += " " + cell + " |";
    text += "\n";
    if (i > 0) continue;
    text += "|";
    for (size_t c = 0; c < lines[0].size(); ++c) text += c == 0 ? "---|" : "---:|";
    text += "\n";
  }
  const std::string notes = Notes(comparison);
  text += "\n";
  for (const char c : notes) text += c == '\n' ? std::string("\\\n") : std::string(1, c);
  return text + "\n";
}

}  // namespace mvstudio::app
