#include <cmath>

#include "core/format.h"
#include "report/page/html.h"
#include "report/svg/svg.h"
#include "stages/error_budget/run.h"

namespace mvstudio::stages {
namespace {

std::string SharesFigure(const char* title, const char* unit, const triangulate::BudgetMeasure& measure) {
  if (measure.num == 0) return "";
  report::BarChartSpec spec;
  spec.title = title;
  spec.value.label = std::string("share (") + unit + ")", spec.value.zero = true;
  report::BarSeries shares{"share", {}, {}};
  for (const triangulate::BudgetStage stage : triangulate::kBudgetStages) {
    const triangulate::BudgetShare& share = measure.stages[static_cast<size_t>(stage)];
    spec.labels.emplace_back(ToString(stage));
    shares.values.push_back(share.share), shares.sigma.push_back((share.high - share.low) / 2);
  }
  spec.labels.emplace_back("rest");
  shares.values.push_back(measure.rest), shares.sigma.push_back(0);
  spec.series = {shares};
  return report::FigureHtml(
      report::BarChart(spec),
      Format("%.3g %s now; the shares and the rest sum to it. Lines: 95 %% of a bootstrap over frames.", measure.now, unit));
}

std::string StatedFigure(const triangulate::StatedBudget& budget) {
  report::BarChartSpec spec;
  spec.title = "Left-out cameras: parts of the mean square";
  spec.value.label = "part (px\u00b2)", spec.value.zero = true;
  report::BarSeries parts{"part", {}, {}};
  for (const triangulate::StatedShare& share : budget.stages) {
    spec.labels.emplace_back(ToString(share.stage));
    parts.values.push_back(share.stated ? share.share_px2 : std::nan("")), parts.sigma.push_back(share.share_error_px2);
  }
  spec.labels.emplace_back("rest");
  parts.values.push_back(budget.rest_px2), parts.sigma.push_back(0);
  spec.series = {parts};
  return report::FigureHtml(report::BarChart(spec), Format("%.3g px\u00b2 in all; a dash states no sigma.", budget.mean_px2));
}

std::string ReliabilityFigure(const StageReliability& stage) {
  report::LineChartSpec spec;
  spec.title = stage.stage;
  spec.x.label = "stated probability", spec.y.label = "part of the errors within";
  spec.x.zero = spec.y.zero = true;
  spec.series = {{"measured", stage.is.stated, stage.is.observed}, {"true sigmas", {0, 1}, {0, 1}, true}};
  spec.width = 360, spec.height = 300;
  return report::FigureHtml(report::LineChart(spec), Format("%d errors; expected calibration error %.3f (by chance %.3f).",
                                                            stage.is.num, stage.is.error, stage.is.chance));
}

}  // namespace

std::string ErrorBudgetPage(const ErrorBudgetReport& report) {
  std::vector<report::Section> sections;
  if (report.budget) {
    sections.push_back({"shares", "Where the error comes from",
                        report::GridHtml({SharesFigure("3D joints", "mm", report.budget->joints_mm),
                                          SharesFigure("Left-out cameras", "px", report.budget->held_out_px),
                                          SharesFigure("Joints without a position", "%", report.budget->missing)})});
  }
  if (report.stated) sections.push_back({"shares", "Where the error comes from", StatedFigure(*report.stated)});
  std::vector<std::string> figures;
  for (const StageReliability& stage : report.reliability) {
    if (stage.is.num > 0) figures.push_back(ReliabilityFigure(stage));
  }
  if (!figures.empty()) sections.push_back({"reliability", "Are the sigmas true", report::GridHtml(figures)});
  return report::PageHtml("mvstudio error-budget", "", sections, "");
}

}  // namespace mvstudio::stages
