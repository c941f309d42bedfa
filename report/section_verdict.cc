#include <cmath>

#include "report/figures.h"
#include "report/page/format.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace {

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

/// Three digits, of counts all: "3 908 288", "10.4 million", "below 0.001%".
std::string CardNumber(double number, const std::string& unit) {
  const double magnitude = std::fabs(number);
  if (unit.empty() && magnitude >= 1000 && number == std::floor(number)) return FormatCount(number);
  if (magnitude >= 1e6) return FormatNumber(number / 1e6, 3) + "\u00a0million" + (unit.empty() ? "" : "\u00a0" + unit);
  if (magnitude >= 1000) return FormatCount(number) + (unit.empty() ? "" : "\u00a0" + unit);
  const double least = unit.empty() || unit == "%" ? 1e-3 : 1e-4;
  if (magnitude > 0 && magnitude < least) return "below " + FormatWithUnit(least, unit);
  return FormatWithUnit(number, unit, 3);
}

std::string StageCard(const Stage& stage, bool with_folder, bool with_errors) {
  std::vector<std::pair<std::string, std::string>> pairs;
  const Value& metrics = stage.metrics();
  for (const Figure& figure : Figures()) {
    if (!figure.on_card || stage.command != figure.command) continue;
    const double number = FigureNumber(figure, metrics);
    if (std::isfinite(number)) pairs.emplace_back(figure.label, CardNumber(number, figure.unit));
  }
  const bool has_figures = !pairs.empty();
  for (const bool speeds : {false, true}) {  // a speed tells least
    for (const auto& [key, value] : metrics.fields()) {
      const KeyLabel label = LabelOfKey(key);
      const bool is_speed = label.label.find("per second") != std::string::npos;
      if (has_figures || !value.IsNumber() || is_speed != speeds || key == "wall_s" || key == "ranks") continue;
      if (pairs.size() < (speeds ? 1 : 3) && label.label.size() < 26)
        pairs.emplace_back(label.label, CardNumber(value.Number(), label.unit));
    }
  }
  const auto [passed, total] = CountChecks(metrics["checks"]);
  if (total > 0) pairs.emplace_back("checks kept", std::to_string(passed) + " of " + std::to_string(total));
  if (std::isfinite(stage.result.Path("timing.wall_s").Number()))
    pairs.emplace_back("took", FormatDuration(stage.result.Path("timing.wall_s").Number()));
  std::string body = Pairs(pairs);
  if (!with_errors) return Card(stage.command, stage.verdict, body);
  for (const Value& error : stage.result["errors"].items()) body += ParagraphHtml(error["text"].Text(error.Text()));
  const std::string name = stage.command + (with_folder && !stage.folder.empty() ? " \u2013 " + stage.folder : "");
  return Card(name, stage.verdict, body);
}

}  // namespace

std::string StageCards(const RunData& data, bool for_studio) {
  std::string cards;
  for (const Stage& stage : data.stages) cards += StageCard(stage, data.All(stage.command).size() > 1, for_studio);
  return cards.empty() ? "" : "<div class=\"cards\">" + cards + "</div>\n";
}

Section VerdictSection(SectionContext* context) {
  return {"verdict", "Verdict", StageCards(context->data, true) + WhatToFix(*context)};
}

}  // namespace mvstudio::report
