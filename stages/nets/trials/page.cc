#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "core/join.h"
#include "report/page/format.h"
#include "report/page/html.h"
#include "report/svg/svg.h"
#include "stages/nets/trials/trials.h"

namespace mvstudio::stages {
namespace {

using Trials = std::vector<AvatarTrial>;

std::string CamerasText(size_t count) { return std::to_string(count) + (count == 1 ? " camera" : " cameras"); }

std::string FrontFigure(const Trials& trials, size_t cameras, bool rendering) {
  report::ParetoChartSpec spec;
  spec.title = CamerasText(cameras) + (rendering ? ": rendering" : ": training");
  spec.cost.label = rendering ? "time to render a frame (ms)" : "training (s)";
  spec.error.label = "1 - SSIM, cameras and motion held out";
  spec.cost.log = true;
  spec.width = 560;
  for (const AvatarTrial& t : trials) {
    const double cost = rendering ? t.ms_per_frame : t.train_s;
    if (t.cameras.size() != cameras || !std::isfinite(cost) || !std::isfinite(t.ssim)) continue;
    spec.points.push_back({t.Name(), cost, 1 - t.ssim, rendering ? t.render_front : t.train_front});
  }
  return spec.points.empty() ? "" : report::FigureHtml(report::ParetoChart(spec), "");
}

/// One line a setting: what more cameras give.
std::string CamerasFigure(const Trials& trials) {
  report::LineChartSpec spec;
  spec.title = "What more cameras give";
  spec.x.label = "cameras trained on", spec.y.label = "SSIM, cameras and motion held out";
  spec.width = 760;
  std::set<size_t> counts;
  for (const AvatarTrial& t : trials) {
    if (!std::isfinite(t.ssim)) continue;
    counts.insert(t.cameras.size());
    const auto same = [&](const report::LineSeries& series) { return series.name == t.Name(); };
    auto series = std::find_if(spec.series.begin(), spec.series.end(), same);
    if (series == spec.series.end()) {
      spec.series.emplace_back();
      series = std::prev(spec.series.end());
      series->name = t.Name();
    }
    series->x.push_back(static_cast<double>(t.cameras.size())), series->y.push_back(t.ssim);
  }
  constexpr size_t kMostLines = 8;
  if (counts.size() < 2 || spec.series.size() > kMostLines) return "";
  for (report::LineSeries& series : spec.series) {
    std::vector<std::pair<double, double>> points;
    for (size_t i = 0; i < series.x.size(); ++i) points.emplace_back(series.x[i], series.y[i]);
    std::sort(points.begin(), points.end());
    for (size_t i = 0; i < points.size(); ++i) std::tie(series.x[i], series.y[i]) = points[i];
  }
  return report::FigureHtml(report::LineChart(spec), "");
}

std::string TrialTable(const Trials& trials) {
  report::Table table("");
  table.AddColumn("method", "", false);
  for (const char* name : {"cameras", "size", "width", "Gaussians", "steps"})
    table.AddColumn(name, std::string(name) == "size" ? "px" : "");
  table.AddColumn("loss", "", false);
  table.AddColumn("SSIM"), table.AddColumn("PSNR", "dB"), table.AddColumn("mask IoU"), table.AddColumn("FD"),
      table.AddColumn("KID");
  table.AddColumn("training", "s"), table.AddColumn("a step", "s"), table.AddColumn("a frame", "ms");
  table.AddColumn("parameters"), table.AddColumn("memory", "MB");
  for (const AvatarTrial& t : trials) {
    const bool gaussians = t.method == "gaussians";
    table.AddRow({t.method,
                  std::to_string(t.cameras.size()),
                  std::to_string(t.size_px),
                  gaussians ? report::kNoNumber : std::to_string(t.width),
                  !gaussians        ? report::kNoNumber
                  : t.gaussians > 0 ? std::to_string(t.gaussians)
                                    : "automatic",
                  std::to_string(t.steps),
                  t.loss,
                  {report::FormatFixed(t.ssim, 4), t.train_front},
                  report::FormatFixed(t.psnr_db, 2),
                  report::FormatFixed(t.mask_iou, 3),
                  report::FormatNumber(t.fd),
                  report::FormatNumber(t.kid),
                  {report::FormatNumber(t.train_s), t.train_front},
                  report::FormatNumber(t.s_per_step, 3),
                  {report::FormatNumber(t.ms_per_frame, 3), t.render_front},
                  report::FormatCount(t.parameters),
                  report::FormatNumber(t.peak_rss_mb, 3)});
  }
  return table.Html();
}

}  // namespace

std::string TrialsPage(const Trials& trials, const AvatarTradeoffOptions& options) {
  std::set<size_t> counts;
  for (const AvatarTrial& t : trials) counts.insert(t.cameras.size());
  std::vector<std::string> figures;
  for (const size_t count : counts) {
    for (const bool rendering : {false, true}) {
      const std::string figure = FrontFigure(trials, count, rendering);
      if (!figure.empty()) figures.push_back(figure);
    }
  }
  const std::string intro =
      report::ParagraphHtml("Held out: cameras " + Join(options.holdout_cameras, ", ") + ", frames " + options.holdout_frames +
                            ". All trials are scored at " + std::to_string(options.score_size_px) +
                            " px, renders of other sizes scaled to it. Large dots: no other trial with as many "
                            "cameras is both better and faster.");
  const std::vector<report::Section> sections{{"front", "Speed against accuracy", intro + report::GridHtml(figures)},
                                              {"cameras", "Cameras", CamerasFigure(trials)},
                                              {"table", "All trials", TrialTable(trials)}};
  std::vector<report::Section> shown;
  for (const report::Section& section : sections) {
    if (!section.body_html.empty()) shown.push_back(section);
  }
  return report::PageHtml("mvstudio tradeoff avatar", "", shown, "");
}

}  // namespace mvstudio::stages
