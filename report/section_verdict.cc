#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "report/page/format.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace {

struct KeyFigure {
  const char* command;
  const char* label;
  std::vector<std::string> keys;  ///< first that is a number
  const char* unit;
};

/// The two or three numbers that tell most about a stage.
const std::vector<KeyFigure>& KeyFigures() {
  static const std::vector<KeyFigure> figures = {
      {"calibrate", "rms", {"rms_px"}, "px"},
      {"calibrate", "held-out rms", {"holdout_rms_px"}, "px"},
      {"calibrate", "baseline", {"baseline_mm"}, "mm"},
      {"triangulate", "median rms", {"median_rms_px"}, "px"},
      {"triangulate", "median \u03c3", {"median_sigma_mm"}, "mm"},
      {"triangulate", "off the reference", {"truth.median_mm", "reference.median_mm", "trc.median_mm"}, "mm"},
      {"triangulate", "joints", {"num_points"}, ""},
      {"pose2d", "camera left out", {"agreement.median_px"}, "px"},
      {"mask", "images", {"pictures"}, ""},
      {"mask", "flicker", {"flicker"}, ""},
      {"avatar eval", "SSIM", {"holdout.ssim"}, ""},
      {"avatar eval", "PSNR", {"holdout.psnr_db"}, "dB"},
      {"avatar eval", "mask IoU", {"holdout.mask_iou"}, ""},
      {"demo", "rig rotation", {"truth.rig_rotation_deg"}, "\u00b0"},
      {"demo", "rig position", {"truth.rig_translation_mm"}, "mm"},
      {"demo", "joints, median", {"truth.joints_median_mm"}, "mm"},
  };
  return figures;
}

std::string Pairs(const std::vector<std::pair<std::string, std::string>>& pairs) {
  std::string html = "<dl>";
  for (const auto& [label, text] : pairs) html += "<dt>" + EscapeHtml(label) + "</dt><dd>" + EscapeHtml(text) + "</dd>";
  return html + "</dl>";
}

const char* CardClass(Verdict verdict) {
  static constexpr const char* kClasses[] = {"card pass", "card warn", "card fail", "card idle"};
  return kClasses[static_cast<int>(verdict)];
}

std::string Card(const std::string& name, Verdict verdict, const std::string& body_html) {
  return std::string("<div class=\"") + CardClass(verdict) + "\"><h3><span>" + EscapeHtml(name) + "</span>" +
         BadgeHtml(verdict) + "</h3>" + body_html + "</div>\n";
}

std::pair<int, int> CountChecks(const Value& checks) {
  int passed = 0;
  for (const Value& check : checks.items()) passed += check["pass"].Flag() ? 1 : 0;
  return {passed, static_cast<int>(checks.items().size())};
}

/// Counts with thin spaces, everything else with its unit.
std::string CardNumber(double number, const std::string& unit) {
  const bool count = unit.empty() && std::fabs(number) >= 1000 && number == std::floor(number);
  return count ? FormatCount(number) : FormatWithUnit(number, unit);
}

std::string StageCard(const Stage& stage, bool with_folder) {
  std::vector<std::pair<std::string, std::string>> pairs;
  const Value& metrics = stage.metrics();
  for (const KeyFigure& figure : KeyFigures()) {
    const double number = metrics.FirstNumber(figure.keys);
    if (stage.command == figure.command && std::isfinite(number))
      pairs.emplace_back(figure.label, CardNumber(number, figure.unit));
  }
  if (pairs.empty()) {
    for (const auto& [key, value] : metrics.fields()) {
      const KeyLabel label = LabelOfKey(key);
      if (value.IsNumber() && key != "wall_s" && pairs.size() < 3 && label.label.size() < 26)
        pairs.emplace_back(label.label, CardNumber(value.Number(), label.unit));
    }
  }
  const auto [passed, total] = CountChecks(metrics["checks"]);
  if (total > 0) pairs.emplace_back("checks kept", std::to_string(passed) + " of " + std::to_string(total));
  if (std::isfinite(stage.result.Path("timing.wall_s").Number()))
    pairs.emplace_back("took", FormatDuration(stage.result.Path("timing.wall_s").Number()));
  std::string body = Pairs(pairs);
  for (const Value& error : stage.result["errors"].items()) body += ParagraphHtml(error["text"].Text(error.Text()));
  const std::string name = stage.command + (with_folder && !stage.folder.empty() ? " \u2013 " + stage.folder : "");
  return Card(name, stage.verdict, body);
}

std::string Cards(const RunData& data) {
  std::string cards;
  for (const Stage& stage : data.stages) cards += StageCard(stage, data.All(stage.command).size() > 1);
  const auto ran = [&](const std::string& command) { return !data.All(command).empty(); };
  if (!ran("calibrate") && data.calibrations.empty()) cards += Card("calibrate", Verdict::kNotRun, "");
  if (!ran("triangulate") && data.points.empty()) cards += Card("triangulate", Verdict::kNotRun, "");
  if (!ran("dataset build") && !ran("dataset verify") && !ran("dataset import")) cards += Card("dataset", Verdict::kNotRun, "");
  if (!ran("avatar train") && !ran("avatar resume") && data.histories.empty())
    cards += Card("avatar train", Verdict::kNotRun, "");
  if (!ran("avatar eval")) cards += Card("avatar eval", Verdict::kNotRun, "");
  return "<div class=\"cards\">" + cards + "</div>\n";
}

struct Item {
  bool error;
  std::string code, text, hint, from;
};

void AddNotices(const Value& list, bool error, const std::string& from, std::vector<Item>* items) {
  for (const Value& notice : list.items()) {
    items->push_back({error || notice["level"].Text() == "fail", notice["code"].Text(), notice["text"].Text(notice.Text()),
                      notice["hint"].Text(), from});
  }
}

/// Errors, missed checks, then warnings, each once, in the order of the pipeline.
std::vector<Item> WhatToFix(const SectionContext& context) {
  std::vector<Item> items, unique;
  for (const Stage& stage : context.data.stages) {
    AddNotices(stage.result["errors"], true, stage.command, &items);
    for (const Value& check : stage.metrics()["checks"].items()) {
      if (check["pass"].kind() != Value::Kind::kBool || check["pass"].Flag()) continue;
      const std::string unit = check["unit"].Text();
      items.push_back({stage.verdict == Verdict::kFail, "CHECK",
                       check["name"].Text("?") + ": " + FormatWithUnit(check["value"].Number(), unit) + ", bound " +
                           FormatWithUnit(check["bound"].Number(), unit),
                       "", stage.command});
    }
  }
  for (const Stage& stage : context.data.stages) AddNotices(stage.result["warnings"], false, stage.command, &items);
  for (const std::vector<Notice>* list : {&context.data.warnings, &context.warnings}) {
    for (const Notice& notice : *list) items.push_back({false, notice.code, notice.text, notice.hint, "report"});
  }
  std::set<std::pair<std::string, std::string>> seen;
  for (Item& item : items) {
    if (seen.emplace(item.code, item.text).second) unique.push_back(std::move(item));
  }
  std::stable_sort(unique.begin(), unique.end(), [](const Item& a, const Item& b) { return a.error > b.error; });
  return unique;
}

std::string FixList(const std::vector<Item>& items) {
  if (items.empty()) return ParagraphHtml("No warnings.");
  constexpr size_t kShown = 12;
  std::string shown, hidden;
  for (size_t i = 0; i < items.size(); ++i) {
    const Item& item = items[i];
    std::string html =
        std::string("<li") + (item.error ? " class=\"fail\">" : ">") + "<strong>" + EscapeHtml(item.text) + "</strong>";
    if (!item.hint.empty()) html += "<span class=\"hint\">\u2192 " + EscapeHtml(item.hint) + "</span>";
    html +=
        " <span class=\"from\">" + EscapeHtml(item.from + (item.code.empty() ? "" : " \u00b7 " + item.code)) + "</span></li>\n";
    (i < kShown ? shown : hidden) += html;
  }
  std::string html = "<ol class=\"fix\">" + shown + "</ol>\n";
  if (!hidden.empty())
    html += DetailsHtml(std::to_string(items.size() - kShown) + " more", "<ol class=\"fix\">" + hidden + "</ol>\n");
  return html;
}

}  // namespace

Verdict OverallVerdict(const RunData& data) {
  Verdict overall = Verdict::kNotRun;
  for (const Stage& stage : data.stages) {
    overall = Worse(overall, stage.verdict);
  }
  if (!data.warnings.empty()) overall = Worse(overall, Verdict::kWarn);
  return overall;
}

Section VerdictSection(SectionContext* context) {
  Section section{"verdict", "Verdict", ""};
  const std::vector<Item> items = WhatToFix(*context);
  section.body_html = Cards(context->data) + "<h3>What to fix first</h3>\n" + FixList(items);
  return section;
}

}  // namespace mvstudio::report
