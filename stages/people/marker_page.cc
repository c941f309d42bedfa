#include <algorithm>

#include "core/format.h"
#include "report/page/html.h"
#include "report/svg/svg.h"
#include "stages/people/marker_export.h"

namespace mvstudio::stages {
namespace {

constexpr int kMostFrames = 600;

/// Frames that are drawn.
struct Stretch {
  int begin = 0, end = 0;
};

Stretch StretchOf(const markers::MarkerTake& take) {
  const int begin = std::max(0, (take.num_frames() - kMostFrames) / 2);
  return {begin, std::min(take.num_frames(), begin + kMostFrames)};
}

report::LineSeries Curve(const markers::MarkerTake& take, int marker, int axis, const Stretch& stretch) {
  report::LineSeries series;
  for (int f = stretch.begin; f < stretch.end; ++f) {
    series.x.push_back(take.first_frame + f);
    series.y.push_back(take.x_in_world[take.Index(f, marker)][axis]);
  }
  return series;
}

std::string JointChart(const MarkerWork& work, int marker, const Stretch& stretch) {
  report::LineChartSpec spec;
  spec.title = work.after.names[static_cast<size_t>(marker)];
  spec.x.label = "frame", spec.y.label = "position in world (m)";
  spec.height = 240;
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool after : {false, true}) {
      report::LineSeries series = Curve(after ? work.after : work.before, marker, axis, stretch);
      series.name = std::string(1, static_cast<char>('x' + axis)) + (after ? "" : " before");
      series.colour = axis, series.dashed = !after;
      spec.series.push_back(std::move(series));
    }
  }
  return report::FigureHtml(report::LineChart(spec), "");
}

report::Section PersonSection(const MarkerWork& work) {
  const Stretch stretch = StretchOf(work.after);
  std::vector<std::string> charts;
  for (int m = 0; m < work.after.num_markers(); ++m) charts.push_back(JointChart(work, m, stretch));
  const std::string text =
      Format("Frames %d to %d of %d. Dashed: before filling and filtering.", work.after.first_frame + stretch.begin,
             work.after.first_frame + stretch.end - 1, work.after.num_frames());
  report::Section section;
  section.id = "person" + std::to_string(work.after.person);
  section.title = "Person " + std::to_string(work.after.person);
  section.body_html = report::ParagraphHtml(text) + report::GridHtml(charts);
  return section;
}

}  // namespace

std::string MarkerPage(const std::vector<MarkerWork>& work, const MarkerOptions& options) {
  std::vector<report::Section> sections;
  for (const MarkerWork& person : work) sections.push_back(PersonSection(person));
  const std::string about = Format("Filter %s, gaps of at most %d frames filled, %g frames a second.",
                                   ToText(markers::ParseFilter(options.filter)).c_str(), options.fill_frames, options.rate_hz);
  return report::PageHtml("Markers", report::ParagraphHtml(about), sections, "");
}

}  // namespace mvstudio::stages
