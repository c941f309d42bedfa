#include <fstream>
#include <functional>
#include <map>

#include "bench/triangulation.h"
#include "report/page/html.h"
#include "report/svg/svg.h"

namespace mvstudio::bench {
namespace {

/// A line for each method and number of threads among the rows of a problem.
std::string Chart(const std::vector<TriangulationRow>& rows, const std::string& problem, const std::string& title,
                  const std::string& label, const std::function<double(const TriangulationRow&)>& along) {
  std::map<std::string, report::LineSeries> series;
  for (const TriangulationRow& row : rows) {
    if (row.problem != problem) continue;
    const std::string name = row.method + (row.threads == 1 ? ", 1 thread" : ", " + std::to_string(row.threads) + " threads");
    report::LineSeries& line = series[name];
    line.name = name;
    line.dashed = row.threads > 1;
    line.x.push_back(along(row));
    line.y.push_back(row.points_per_s);
  }
  report::LineChartSpec spec;
  spec.title = title;
  spec.x = {label, true, false};
  spec.y = {"points a second", true, false};
  for (auto& [name, line] : series) spec.series.push_back(std::move(line));
  return report::FigureHtml(report::LineChart(spec), "");
}

}  // namespace

void WriteScalingFigure(const std::vector<TriangulationRow>& rows, const std::string& path) {
  const std::string body =
      Chart(rows, "scaling with points", "Five views", "points",
            [](const TriangulationRow& row) { return static_cast<double>(row.points); }) +
      Chart(rows, "scaling with views", "50 000 points", "views", [](const TriangulationRow& row) { return row.views; });
  std::ofstream(path) << report::PageHtml("bench_triangulation", "", {{"scaling", "Speed of triangulation", body}}, "");
}

}  // namespace mvstudio::bench
