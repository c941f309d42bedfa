#pragma once

#include <string>
#include <vector>

#include "report/svg/canvas.h"
#include "report/svg/svg.h"

namespace mvstudio::report {

/// Maps data to an interval of the canvas, linear or logarithmic, with its ticks.
class Scale {
 public:
  /// The range covers the finite values of `values`, extended to round numbers; `from`, `to` are canvas px (to < from for
  /// y up).
  Scale(const Axis& axis, const std::vector<double>& values, double from, double to);

  double operator()(double value) const;  ///< NaN for what has no place (not finite, or not positive on a logarithmic axis)
  const std::vector<double>& ticks() const { return ticks_; }
  std::string Label(double tick) const;
  bool log() const { return log_; }
  double low() const { return low_; }
  double high() const { return high_; }

 private:
  bool log_ = false;
  double low_ = 0, high_ = 1, from_, to_;
  std::vector<double> ticks_;
};

/// Grid lines, tick labels and the axis title below / left of the plot rectangle.
void DrawBottomAxis(SvgCanvas* canvas, const Scale& scale, const std::string& label, double left, double right, double top,
                    double bottom);
void DrawLeftAxis(SvgCanvas* canvas, const Scale& scale, const std::string& label, double left, double right, double top,
                  double bottom);

/// Swatches with names, in rows within [left, right]; returns the height used. With `canvas` null it only measures.
double DrawLegend(SvgCanvas* canvas, const std::vector<std::string>& names, const std::vector<int>& colours, double left,
                  double right, double top);

}  // namespace mvstudio::report
