#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "report/page/format.h"
#include "report/page/html.h"
#include "report/svg/svg.h"
#include "stages/pack_speed/measure.h"

namespace mvstudio::stages {
namespace {

constexpr double kGoodPsnr = 40;

std::string WayName(const PackSpeedTrial& t) { return t.Way() + " " + t.codec; }

std::string PsnrText(const PackSpeedTrial& t) {
  return std::isfinite(t.psnr_db) ? report::FormatFixed(t.psnr_db, 1) : std::string("exact");
}

std::string CropName(int crop_px) { return crop_px ? std::to_string(crop_px) + " px" : std::string("whole images"); }

/// One line a way, over the crop sizes; trials of one thread. Empty when there is only one size.
template <class Value>
std::string OverSizes(const PackSpeedReport& report, const std::string& title, const report::Axis& axis, const Value& value) {
  report::LineChartSpec spec;
  spec.title = title;
  spec.x.label = "edge of the crop (px)", spec.x.log = true;
  spec.y = axis;
  std::set<int> sizes;
  for (const PackSpeedTrial& t : report.trials) {
    if (t.threads != 1 || t.crop_px == 0) continue;
    sizes.insert(t.crop_px);
    const auto same = [&t](const report::LineSeries& s) { return s.name == WayName(t); };
    auto series = std::find_if(spec.series.begin(), spec.series.end(), same);
    if (series == spec.series.end()) {
      report::LineSeries added;
      added.name = WayName(t), added.dashed = t.from_folder;
      series = spec.series.insert(spec.series.end(), added);
    }
    series->x.push_back(t.crop_px), series->y.push_back(value(t));
  }
  return sizes.size() < 2 ? std::string() : report::FigureHtml(report::LineChart(spec), "");
}

/// Time against size of the ways that keep the quality.
std::string SizeFigure(const PackSpeedReport& report, int crop_px) {
  report::ParetoChartSpec spec;
  spec.title = CropName(crop_px) + ": ways of " + report::FormatNumber(kGoodPsnr) + " dB and more";
  spec.cost.label = "time to read one, one thread (ms)", spec.error.label = "size of one (KiB)";
  spec.cost.log = spec.error.log = true;
  spec.width = 480;
  for (const PackSpeedTrial& t : report.trials) {
    if (t.threads != 1 || t.crop_px != crop_px || !(t.psnr_db >= kGoodPsnr)) continue;
    spec.points.push_back({WayName(t) + " (" + PsnrText(t) + ")", 1e3 / t.crops_per_s, t.bytes_per_crop / 1024, true});
  }
  for (report::ParetoPoint& a : spec.points) {
    for (const report::ParetoPoint& b : spec.points) {
      if (b.cost <= a.cost && b.error <= a.error && (b.cost < a.cost || b.error < a.error)) a.on_front = false;
    }
  }
  return spec.points.empty() ? std::string() : report::FigureHtml(report::ParetoChart(spec), "");
}

std::string TrialTable(const PackSpeedReport& report, const std::vector<bool>& on_front) {
  report::Table table("");
  table.AddColumn("way", "", false);
  table.AddColumn("size", "", false);
  table.AddColumn("threads");
  table.AddColumn("read", "1/s");
  table.AddColumn("times the JPEG folder");
  table.AddColumn("bytes", "KiB");
  table.AddColumn("PSNR", "dB");
  std::map<std::pair<int, int>, double> folder;
  for (const PackSpeedTrial& t : report.trials) {
    if (t.from_folder && !folder.count({t.crop_px, t.threads})) folder[{t.crop_px, t.threads}] = t.crops_per_s;
  }
  for (size_t i = 0; i < report.trials.size(); ++i) {
    const PackSpeedTrial& t = report.trials[i];
    table.AddRow({{WayName(t), static_cast<bool>(on_front[i])},
                  CropName(t.crop_px),
                  std::to_string(t.threads),
                  report::FormatNumber(t.crops_per_s),
                  report::FormatNumber(t.crops_per_s / folder[{t.crop_px, t.threads}], 3),
                  report::FormatNumber(t.bytes_per_crop / 1024),
                  PsnrText(t)});
  }
  return table.Html();
}

std::string BuildTable(const PackSpeedReport& report) {
  report::Table table("");
  table.AddColumn("pack", "", false);
  table.AddColumn("size", "", false);
  table.AddColumn("threads");
  table.AddColumn("built", "1/s");
  table.AddColumn("decoding alone", "1/s");
  table.AddColumn("decoding's share of the work", "%");
  for (const PackBuildSpeed& b : report.builds) {
    table.AddRow({b.codec, CropName(b.crop_px), std::to_string(b.threads), report::FormatNumber(b.build_per_s, 3),
                  report::FormatNumber(b.decode_per_s, 3), report::FormatFixed(100 * b.decode_share, 0)});
  }
  return table.Html();
}

std::string Intro(const PackSpeedReport& report) {
  return report::ParagraphHtml("Crops of people read at random from " + std::to_string(report.images) + " images of " +
                               std::to_string(report.width_px) + "x" + std::to_string(report.height_px) +
                               " px: out of a pack, or from a folder of JPEG images that are decoded and cropped when read. "
                               "PSNR is against the crop of the lossless image. Files are in the system's cache.");
}

}  // namespace

std::string PackSpeedPage(const PackSpeedReport& report, const std::vector<bool>& on_front) {
  const std::vector<std::string> lines{OverSizes(report, "Reading", {"crops a second, one thread (1/s)", true, false},
                                                 [](const PackSpeedTrial& t) { return t.crops_per_s; }),
                                       OverSizes(report, "Size", {"bytes a crop (KiB)", true, false},
                                                 [](const PackSpeedTrial& t) { return t.bytes_per_crop / 1024; }),
                                       OverSizes(report, "Quality (exact ways are left out)", {"PSNR (dB)", false, false},
                                                 [](const PackSpeedTrial& t) { return t.psnr_db; })};
  std::vector<std::string> figures;
  std::copy_if(lines.begin(), lines.end(), std::back_inserter(figures), [](const std::string& f) { return !f.empty(); });
  std::set<int> sizes;
  for (const PackSpeedTrial& t : report.trials) sizes.insert(t.crop_px);
  std::vector<std::string> fronts;
  for (const int crop_px : sizes) {
    const std::string figure = SizeFigure(report, crop_px);
    if (!figure.empty()) fronts.push_back(figure);
  }
  const std::vector<report::Section> sections{
      {"reading", "Packs beside a folder of JPEG images", Intro(report) + report::GridHtml(figures)},
      {"front", "Time against size",
       report::GridHtml(fronts) + report::ParagraphHtml("Large dots: no other way is both faster and smaller.")},
      {"table", "All ways",
       TrialTable(report, on_front) +
           report::ParagraphHtml("Bold: no other way of this size is faster, smaller and better at once.")},
      {"building", "Making a pack", BuildTable(report)}};
  return report::PageHtml("mvstudio tradeoff pack", "", sections, "");
}

}  // namespace mvstudio::stages
