#include <algorithm>
#include <cmath>

#include "report/page/format.h"
#include "report/svg/axes.h"
#include "report/svg/canvas.h"
#include "report/svg/labels.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

void DrawMethod(SvgCanvas* canvas, double x, double y, const ParetoPoint& p, const std::string& tip) {
  const double radius = p.on_front ? 5 : 3.5;
  const std::string fill = p.on_front ? "f0" : "f1";
  if (p.style == PointStyle::kSquare) {
    canvas->Rect(x - radius, y - radius, 2 * radius, 2 * radius, fill, tip);
    return;
  }
  if (p.style == PointStyle::kRinged) canvas->Rings({{x, y}}, "axis", radius + 3.5, 1.5);
  canvas->Circle(x, y, radius, fill, tip);
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
    DrawMethod(&canvas, x(p.cost), y(p.error), p, tip);
  }
  constexpr double kRightAndUp = -0.6;
  std::vector<PointLabel> labels;
  for (const ParetoPoint& p : spec.points) {
    if (p.on_front || p.style != PointStyle::kDot) labels.push_back({{x(p.cost), y(p.error)}, p.name, kRightAndUp});
  }
  DrawPointLabels(&canvas, labels, top, bottom);
  return canvas.Finish();
}

}  // namespace mvstudio::report
