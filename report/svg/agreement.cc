#include "report/svg/agreement.h"

#include "report/page/format.h"
#include "report/svg/axes.h"
#include "report/svg/canvas.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
std::string AgreementChart(const AgreementChartSpec& spec) {
  constexpr double kTitle = 22, kAxis = 42, kMargin = 14;
  std::vector<double> values;
  for (const AgreementPoint& p : spec.points) {
    if (p.predicted > 0 && p.actual > 0) values.insert(values.end(), {p.predicted, p.actual});
  }
  const double left = 70, right = spec.size - kMargin, top = kTitle + 6, bottom = top + right - left;
  SvgCanvas canvas(spec.size, bottom + kAxis, spec.title);
  canvas.Text(2, 14, spec.title, "start", "t");
  const Axis predicted{"predicted " + spec.quantity, true}, actual{"actual " + spec.quantity, true};
  const Scale x(predicted, values, left, right), y(actual, values, bottom, top);
  DrawBottomAxis(&canvas, x, predicted.label, left, right, top, bottom);
  DrawLeftAxis(&canvas, y, actual.label, left, right, top, bottom);
  canvas.BeginClip(left, top, right - left, bottom - top);
  for (const double factor : {1 - spec.band, 1.0, 1 + spec.band})
    canvas.Polyline({{x(x.low()), y(factor * x.low())}, {x(x.high()), y(factor * x.high())}}, "ref", 1, factor != 1.0);
  canvas.EndClip();
  for (const AgreementPoint& p : spec.points) {
    const std::string tip =
        p.name + ": " + FormatNumber(p.predicted, 3) + " predicted, " + FormatNumber(p.actual, 3) + " actual";
    if (p.predicted > 0 && p.actual > 0) canvas.Circle(x(p.predicted), y(p.actual), 4, FillClass(p.colour), tip);
  }
  return canvas.Finish();
}

}  // namespace mvstudio::report
