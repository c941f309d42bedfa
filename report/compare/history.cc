#include <algorithm>
#include <cmath>

#include "core/statistics.h"
#include "report/compare/compared.h"
#include "report/svg/svg.h"

/// Figures over several runs.
namespace mvstudio::report {
namespace {

/// Whether the run's figure may stand beside the first run's.
bool MayStandBeside(const ComparedFigure& figure, size_t run) {
  const Stage *first = figure.stage->runs.front(), *own = figure.stage->runs[run];
  if (!figure.figure->of_held_out || run == 0) return true;
  return first && own && WhyScoresDiffer(*first, *own).empty();
}

std::string ChartOf(const ComparedRuns& runs, const ComparedFigure& figure) {
  const std::string unit = figure.figure->unit;
  BarChartSpec spec;
  spec.title = figure.stage->command + ": " + figure.Name();
  spec.value.label = figure.figure->label + (unit.empty() ? std::string() : " (" + unit + ")");
  spec.labels = runs.names;
  spec.width = 360;
  BarSeries bars{"run", {}, {}};
  for (size_t i = 0; i < runs.size(); ++i) {
    bars.values.push_back(MayStandBeside(figure, i) ? figure.values[i] : std::nan(""));
    bars.sigma.push_back(std::isfinite(figure.half_widths[i]) ? figure.half_widths[i] : 0);
  }
  if (FiniteValues(bars.values).size() < 2) return {};
  if (FiniteValues(figure.half_widths).empty()) bars.sigma.clear();
  spec.series = {bars};
  return FigureHtml(BarChart(spec), bars.sigma.empty() ? "" : "Lines are the stated 95\u00a0% intervals.");
}

}  // namespace

std::string FiguresOverRuns(const ComparedRuns& runs, const std::vector<ComparedFigure>& figures) {
  if (runs.size() < 3) return {};
  std::vector<std::string> charts;
  for (const ComparedFigure& figure : figures) {
    if (!figure.figure->main || !figure.entry.empty()) continue;
    std::string chart = ChartOf(runs, figure);
    if (!chart.empty()) charts.push_back(std::move(chart));
  }
  return charts.empty() ? "" : "<h3>Over the runs</h3>\n" + GridHtml(charts, "grid small");
}

}  // namespace mvstudio::report
