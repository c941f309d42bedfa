#include <algorithm>
#include <cmath>

#include "report/page/format.h"
#include "report/svg/axes.h"
#include "report/svg/canvas.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

/// Heights for labels that begin at x[i] (ascending) and would like to stand at y[i]: each is moved up until it clears those
/// before it.
std::vector<double> PlaceLabels(const std::vector<double>& x, const std::vector<double>& y,
                                const std::vector<std::string>& text) {
  constexpr double kLine = 13, kCharacter = 6.2;
  std::vector<double> placed;
  for (size_t i = 0; i < x.size(); ++i) {
    double height = y[i];
    for (bool free = false; !free;) {
      free = true;
      for (size_t k = 0; k < i; ++k) {
        const bool beside = x[k] + kCharacter * static_cast<double>(text[k].size()) < x[i];
        if (beside || std::abs(placed[k] - height) >= kLine) continue;
        height = placed[k] - kLine;
        free = false;
      }
    }
    placed.push_back(height);
  }
  return placed;
}

}  // namespace

std::string ParetoChart(const ParetoChartSpec& spec) {
  constexpr double kTitle = 22, kAxis = 42, kHeight = 340;
  std::vector<double> xs, ys;
  for (const ParetoPoint& p : spec.points) xs.push_back(p.cost), ys.push_back(p.error);
  const double left = 70, right = spec.width - 14, top = kTitle + 6, bottom = kHeight - kAxis;
  SvgCanvas canvas(spec.width, kHeight, spec.title);
  canvas.Text(2, 14, spec.title, "start", "t");
  const Scale x(spec.cost, xs, left, right), y(spec.error, ys, bottom, top);
  DrawBottomAxis(&canvas, x, spec.cost.label, left, right, top, bottom);
  DrawLeftAxis(&canvas, y, spec.error.label, left, right, top, bottom);
  std::vector<ParetoPoint> front;
  for (const ParetoPoint& p : spec.points) {
    if (p.on_front) front.push_back(p);
  }
  std::sort(front.begin(), front.end(), [](const ParetoPoint& a, const ParetoPoint& b) { return a.cost < b.cost; });
  std::vector<SvgCanvas::Point> line;
  for (const ParetoPoint& p : front) line.emplace_back(x(p.cost), y(p.error));
  canvas.Polyline(line, "s0", 1.5, true);
  for (const ParetoPoint& p : spec.points) {
    const std::string tip = p.name + ": " + FormatNumber(p.cost, 3) + ", " + FormatNumber(p.error, 4);
    canvas.Circle(x(p.cost), y(p.error), p.on_front ? 5 : 3.5, p.on_front ? "f0" : "f1", tip);
  }
  std::vector<double> at_x, at_y;
  std::vector<std::string> names;
  for (const ParetoPoint& p : front) at_x.push_back(x(p.cost) + 7), at_y.push_back(y(p.error) - 5), names.push_back(p.name);
  const std::vector<double> heights = PlaceLabels(at_x, at_y, names);
  for (size_t i = 0; i < front.size(); ++i) {
    const double width = 6.2 * static_cast<double>(names[i].size());
    const bool outside = at_x[i] + width > right;  // then it ends at its point
    canvas.Text(outside ? at_x[i] - 14 : at_x[i], heights[i], names[i], outside ? "end" : "start", "x halo");
  }
  return canvas.Finish();
}

}  // namespace mvstudio::report
