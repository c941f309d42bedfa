#include "stages/study/avatar_table.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <tuple>

#include "core/join.h"
#include "core/statistics.h"
#include "report/page/format.h"

namespace mvstudio::stages {
namespace {

using report::Value;

constexpr char kScoreKeys[][12] = {"ssim", "psnr_db", "mask_iou", "boundary_f", "lpips", "flicker"};
/// Options that change no number of a result.
constexpr char kSilentOptions[][24] = {
    "seed",        "train.device", "train.save-every", "train.report-every", "train.validate-pictures", "train.picture-every",
    "model.method"};

const std::map<std::string, std::string> kMethodNames = {
    {"tna", "TNA"}, {"direct", "Direct"}, {"v2v", "V2V-lite"}, {"gaussians", "Gaussians"}, {"body", "Textured body"}};

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

/// `avatar train` without steps puts textures on a fitted body and trains no network.
bool IsBodyAlone(const ScoredRun& run) {
  return run.metrics["checkpoint_step"].Number() == 0 && run.metrics["training"]["options"]["model.method"].Text() == "tna";
}

Recipe RecipeOf(const ScoredRun& run) {
  Recipe recipe;
  const Value& training = run.metrics["training"];
  recipe.method = IsBodyAlone(run) ? "body" : training["options"]["model.method"].Text("unknown");
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
  if (scored["fd"]["kid"].IsNumber()) scores["kid"] = scored["fd"]["kid"].Number();
  return scores;
}

using Values = std::map<std::string, std::vector<double>>;

void CollectCosts(const ScoredRun& run, Values* costs) {
  const auto add = [&](const char* name, const Value& value, bool inverse = false) {
    if (!value.IsNumber() || !(value.Number() > 0)) return;
    (*costs)[name].push_back(inverse ? 1 / value.Number() : value.Number());
  };
  add("frames_per_s", run.metrics["seconds_per_frame"], true);
  add("train_s", run.train["metrics"]["wall_s"]);
  if (!IsBodyAlone(run)) add("num_parameters", run.metrics["training"]["num_parameters"]);
  add("train_rss_mb", run.train["timing"]["peak_rss_mb"]);
  add("eval_rss_mb", run.timing["peak_rss_mb"]);
}

using ValuesBySplit = std::map<std::string, Values>;

void Collect(const std::string& kind, const Value& scored, ValuesBySplit* values) {
  for (const auto& [key, value] : ScoresOf(scored)) (*values)[kind][key].push_back(value);
}

ComparisonRow RowOf(const std::vector<const ScoredRun*>& runs, const ScoredRun& first, const std::string& primary) {
  ComparisonRow row;
  ValuesBySplit values;
  Values costs;
  std::set<std::string> mixed;
  for (const ScoredRun* run : runs) {
    row.folders.push_back(run->folder);
    row.seeds.push_back(run->metrics["training"]["options"]["seed"].Text("?"));
    Collect(primary, run->metrics["holdout"], &values);
    CollectCosts(*run, &costs);
    for (const auto& [kind, scored] : run->metrics["other_splits"].fields()) {
      Collect(kind, scored, &values);
      if (run->protocol.splits[kind]["sha256"].Text() != first.protocol.splits[kind]["sha256"].Text()) mixed.insert(kind);
    }
  }
  for (const auto& [kind, keys] : values) {
    for (const auto& [key, list] : keys) row.splits[kind].values[key] = SpreadOf(list);
    row.splits[kind].same_images = !mixed.count(kind);
  }
  for (const auto& [name, list] : costs) row.costs[name] = SpreadOf(list);
  return row;
}

ComparisonRow BaselineRow(const std::string& key, const std::string& name, const Value& scored, const std::string& primary) {
  ComparisonRow row;
  row.name = name, row.method = key, row.baseline = true;
  for (const auto& [score, value] : ScoresOf(scored)) row.splits[primary].values[score] = SpreadOf({value});
  return row;
}

/// Those of images are equal for equal training cameras; the fitted body is that of its run.
void AddBaselines(const std::vector<ScoredRun>& runs, Comparison* comparison) {
  for (const auto& [key, name] : {std::pair<std::string, std::string>{"body_alone", "fitted body"},
                                  {"mean_image", "mean image"},
                                  {"nearest_pose", "nearest view"}}) {
    std::map<std::pair<std::vector<std::string>, std::string>, const ScoredRun*> different;
    std::set<std::vector<std::string>> cameras;
    for (const ScoredRun& run : runs) {
      const Value& scored = run.metrics["baselines"][key];
      if (!scored["ssim"].IsNumber()) continue;
      const Recipe recipe = RecipeOf(run);
      different.emplace(std::make_pair(recipe.cameras, key == "body_alone" ? scored["ssim"].Dump() : ""), &run);
      cameras.insert(recipe.cameras);
    }
    for (const auto& [of, run] : different) {
      std::string text = name;
      if (cameras.size() > 1) text += ", " + std::to_string(of.first.size()) + " cameras";
      if (different.size() > cameras.size()) text += ", of " + std::filesystem::path(run->folder).filename().string();
      comparison->rows.push_back(BaselineRow(key, text, run->metrics["baselines"][key], comparison->primary));
      comparison->rows.back().cameras = of.first;
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
      if (!scores.same_images) mixed.insert(kind);
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

}  // namespace mvstudio::stages
