#include <algorithm>

#include "core/format.h"
#include "core/join.h"
#include "report/page/format.h"
#include "report/page/html.h"
#include "report/svg/svg.h"
#include "stages/fronts/fronts.h"

namespace mvstudio::stages {
namespace {

/// "linear (peer)"; the default is called so already.
std::string LabelOf(const FrontWay& way) {
  if (way.mark != WayMark::kPeer) return way.name;
  return way.name + " (peer)";
}

report::PointStyle StyleOf(WayMark mark) {
  switch (mark) {
    case WayMark::kDefault:
      return report::PointStyle::kRinged;
    case WayMark::kPeer:
      return report::PointStyle::kSquare;
    default:
      return report::PointStyle::kDot;
  }
}

std::string FrontFigure(const StageFront& front, bool time) {
  report::ParetoChartSpec spec;
  spec.title = front.stage + (time ? ": time" : ": space");
  spec.cost.label = time ? front.cost : front.space;
  spec.error.label = front.error;
  spec.cost.log = spec.error.log = true;
  spec.width = 560;
  for (const FrontWay& way : front.ways) {
    const double cost = time ? way.time() : way.space();
    if (!std::isfinite(cost) || !std::isfinite(way.error)) continue;
    spec.points.push_back({LabelOf(way), cost, way.error, time ? way.time_front : way.space_front, StyleOf(way.mark)});
  }
  return spec.points.empty() ? "" : report::FigureHtml(report::ParetoChart(spec), "");
}

std::string WaysTable(const StageFront& front) {
  const bool stored =
      std::any_of(front.ways.begin(), front.ways.end(), [](const FrontWay& w) { return std::isfinite(w.stored_kib); });
  report::Table table("");
  table.AddColumn("way", "", false), table.AddColumn("", "", false);
  table.AddColumn("processor time", "s"), table.AddColumn("by the clock", "s"), table.AddColumn("peak memory", "MiB");
  if (stored) table.AddColumn("stored", "KiB");
  table.AddColumn(front.error);
  for (const FrontWay& way : front.ways) {
    if (!way.why_not.empty()) continue;
    std::vector<report::Table::Cell> cells = {{way.name, way.time_front},
                                              std::string(ToString(way.mark)),
                                              {report::FormatNumber(way.cpu_s, 3), way.time_front && !stored},
                                              {report::FormatNumber(way.seconds, 3), way.time_front && stored},
                                              {report::FormatNumber(way.peak_rss_mb, 3), !stored && way.space_front}};
    if (stored) cells.push_back({report::FormatNumber(way.stored_kib, 3), way.space_front});
    cells.push_back({report::FormatNumber(way.error, 4), way.time_front || way.space_front});
    table.AddRow(std::move(cells), way.mark == WayMark::kDefault);
  }
  return table.Html();
}

std::string Commands(const StageFront& front) {
  std::string lines;
  for (const FrontWay& way : front.ways) lines += way.name + ": " + way.command + "\n";
  return report::DetailsHtml("The commands", "<pre>" + report::EscapeHtml(lines) + "</pre>");
}

report::Section SectionOf(const StageFront& front) {
  report::Section section{front.stage, front.stage, "", front.why_not.empty()};
  if (!front.why_not.empty()) {
    section.body_html = report::ParagraphHtml("Not measured: " + front.why_not);
    return section;
  }
  section.body_html = report::GridHtml({FrontFigure(front, true), FrontFigure(front, false)}) + WaysTable(front);
  for (const FrontWay& way : front.ways) {
    if (!way.why_not.empty()) section.body_html += report::ParagraphHtml(way.name + " was not measured: " + way.why_not);
  }
  section.body_html += Commands(front);
  return section;
}

/// Of one stage, the three ways to grow.
std::string GrowthFigure(const std::string& stage, const std::vector<GrowthRow>& rows, bool time) {
  report::LineChartSpec spec;
  spec.title = stage + (time ? ": time" : ": error");
  spec.x = {"times as many", true, false}, spec.y = {time ? "processor time (s)" : "error", true, false};
  spec.width = 340, spec.height = 220;
  int colour = 0;
  for (const GrowthRow& row : rows) {
    if (row.stage != stage) continue;
    if (row.factors.size() > 1) spec.series.push_back({row.axis, row.factors, time ? row.cpu_s : row.error, false, colour});
    ++colour;
  }
  return spec.series.empty() ? "" : report::FigureHtml(report::LineChart(spec), "");
}

std::string NumbersText(const std::vector<double>& numbers, int digits) {
  return Join(numbers, ", ", [&](double number) { return report::FormatNumber(number, digits); });
}

std::string GrowthTable(const std::vector<GrowthRow>& rows) {
  report::Table table("");
  table.AddColumn("stage", "", false), table.AddColumn("grows", "", false), table.AddColumn("times", "", false);
  table.AddColumn("processor time", "s", false), table.AddColumn("exponent"), table.AddColumn("peak memory", "MiB", false);
  table.AddColumn("error", "", false), table.AddColumn("", "", false);
  for (const GrowthRow& row : rows) {
    const std::string exponent = std::isfinite(row.exponent) ? report::FormatNumber(row.exponent, 2) : "flat";
    table.AddRow({row.stage, row.axis, NumbersText(row.factors, 2), NumbersText(row.cpu_s, 3),
                  row.factors.size() > 1 ? exponent : "", NumbersText(row.peak_rss_mb, 3), NumbersText(row.error, 3),
                  row.why_not.empty() ? row.reason : row.why_not});
  }
  return table.Html();
}

report::Section GrowthSection(const Fronts& fronts) {
  report::Section section{"growth", "Growth", "", true};
  std::vector<std::string> figures;
  for (const StageFront& front : fronts.stages) {
    for (const bool time : {true, false}) {
      const std::string figure = GrowthFigure(front.stage, fronts.growth, time);
      if (!figure.empty()) figures.push_back(figure);
    }
  }
  section.body_html = report::ParagraphHtml(
                          "Each stage without flags, on synthetic studios with more cameras, more frames or more pixels than "
                          "the smallest: " +
                          fronts.grown +
                          ". The exponent is k of a time start + c n^k; flat: it grows by "
                          "less than 0.15 s.") +
                      report::GridHtml(figures) + GrowthTable(fronts.growth);
  return section;
}

std::string MachineText(const Fronts& fronts) {
  std::string text = Format("Measured with %d thread%s", fronts.threads, fronts.threads == 1 ? "" : "s");
  if (!fronts.processor.empty()) text += Format(" on %d cores of %s", fronts.cores, fronts.processor.c_str());
  if (std::isfinite(fronts.load)) text += Format(", %.1f other processes running", fronts.load);
  return text + Format("; seed %llu.", fronts.seed);
}

}  // namespace

std::string FrontsPage(const Fronts& fronts) {
  const std::string header =
      "<h1>mvstudio tradeoff all</h1>" + report::ParagraphHtml(fronts.footage) + report::ParagraphHtml(MachineText(fronts)) +
      report::ParagraphHtml(
          "Each way is a command of its own. Errors are of data that took no part. Processor time counts all threads and does "
          "not grow with what else the machine does; the time by the clock does. Large dots: no other way is both cheaper and "
          "better. A ring: what a command does without flags. Squares: peers. How costs grow with people, too: "
          "docs/notes/growth.md, which scripts/growth measures.");
  std::vector<report::Section> sections;
  for (const StageFront& front : fronts.stages) sections.push_back(SectionOf(front));
  if (!fronts.growth.empty()) sections.push_back(GrowthSection(fronts));
  return report::PageHtml("mvstudio tradeoff all", header, sections, "");
}

}  // namespace mvstudio::stages
