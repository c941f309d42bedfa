#include "report/svg/axes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "report/page/format.h"

namespace mvstudio::report {
namespace {

double StepFor(double span, int target) {
  const double raw = span / std::max(1, target);
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  const double fraction = raw / power;
  return power * (fraction < 1.5 ? 1 : fraction < 3.5 ? 2 : fraction < 7.5 ? 5 : 10);
}

std::pair<double, double> FiniteRange(const std::vector<double>& values) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (low > high) return {0, 1};
  return {low, high};
}

}  // namespace

std::vector<double> NiceTicks(double low, double high, int target) {
  std::vector<double> ticks;
  if (!std::isfinite(low) || !std::isfinite(high) || low > high) return ticks;
  const double span = high - low;
  // Below this the ticks would no longer differ in double precision.
  if (!(span > 1e-12 * std::max(std::fabs(low), std::fabs(high)))) return {low};
  const double step = StepFor(span, target);
  const double first = std::ceil(low / step - 1e-9), last = std::floor(high / step + 1e-9);
  for (double i = first; i <= last; ++i) ticks.push_back(i == 0 ? 0.0 : i * step);
  return ticks;
}

std::vector<double> LogTicks(double low, double high) {
  std::vector<double> ticks;
  if (!std::isfinite(low) || !std::isfinite(high) || low <= 0 || low > high) return ticks;
  const int first = static_cast<int>(std::floor(std::log10(low) + 1e-9)),
            last = static_cast<int>(std::ceil(std::log10(high) - 1e-9));
  const int stride = std::max(1, (last - first) / 8);
  const bool few = last - first <= 3;
  for (int power = first; power <= last; power += stride) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      if (factor > 1 && !few) continue;
      // Negative powers are divisions so that 1e-3 is the double nearest to it.
      const double tick = power < 0 ? factor / std::pow(10.0, -power) : factor * std::pow(10.0, power);
      if (tick >= low * (1 - 1e-9) && tick <= high * (1 + 1e-9)) ticks.push_back(tick);
    }
  }
  return ticks;
}

std::string TickLabel(double value, double step) {
  if (!std::isfinite(value)) return kNoNumber;
  const double magnitude = std::fabs(value);
  if (step <= 0) {
    return FormatNumber(value, 3);
  }
  if (magnitude >= 1e7 || step < 1e-6) return FormatNumber(value, 3);
  return FormatFixed(value, std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9))));
}

double NiceBelow(double value) {
  if (!std::isfinite(value) || value <= 0) return 1;
  const double power = std::pow(10.0, std::floor(std::log10(value) + 1e-12));
  const double fraction = value / power * (1 + 1e-12);
  return power * (fraction >= 5 ? 5 : fraction >= 2 ? 2 : 1);
}

Scale::Scale(const Axis& axis, const std::vector<double>& values, double from, double to) : from_(from), to_(to) {
  std::tie(low_, high_) = FiniteRange(values);
  log_ = axis.log && low_ > 0;
  const double spacing = to < from ? 38 : 70;  // labels stand above each other on a vertical axis
  const int target = std::clamp(static_cast<int>(std::fabs(to - from) / spacing), 2, 8);
  if (log_) {
    low_ *= 0.9;
    high_ *= 1.1;
    ticks_ = LogTicks(low_, high_);
    if (ticks_.size() >= 2) return;
    log_ = false;  // less than one decade: a linear axis reads better
  }
  if (axis.zero) low_ = std::min(low_, 0.0), high_ = std::max(high_, 0.0);
  if (low_ == high_) {
    const double half = low_ == 0 ? 1 : 0.5 * std::fabs(low_);
    if (!axis.zero) low_ -= half;
    high_ += half;
  }
  const double step = StepFor(high_ - low_, target);
  if (high_ - low_ > 1e-12 * std::max(std::fabs(low_), std::fabs(high_))) {
    const double margin = 0.35;
    if (low_ != 0) low_ = std::max(std::floor(low_ / step) * step, low_ - margin * step);
    if (high_ != 0) high_ = std::min(std::ceil(high_ / step) * step, high_ + margin * step);
  }
  ticks_ = NiceTicks(low_, high_, target);
}

double Scale::operator()(double value) const {
  if (!std::isfinite(value) || (log_ && value <= 0)) return std::numeric_limits<double>::quiet_NaN();
  const double share = log_ ? std::log(value / low_) / std::log(high_ / low_) : (value - low_) / (high_ - low_);
  return from_ + share * (to_ - from_);
}

std::string Scale::Label(double tick) const { return TickLabel(tick, log_ || ticks_.size() < 2 ? 0 : ticks_[1] - ticks_[0]); }

void DrawBottomAxis(SvgCanvas* canvas, const Scale& scale, const std::string& label, double left, double right, double top,
                    double bottom) {
  for (const double tick : scale.ticks()) {
    canvas->Line(scale(tick), top, scale(tick), bottom, "gridline");
    canvas->Text(scale(tick), bottom + 15, scale.Label(tick), "middle", "m");
  }
  canvas->Line(left, bottom, right, bottom, "axis");
  canvas->Text((left + right) / 2, bottom + 32, label, "middle");
}

void DrawLeftAxis(SvgCanvas* canvas, const Scale& scale, const std::string& label, double left, double right, double top,
                  double bottom) {
  for (const double tick : scale.ticks()) {
    canvas->Line(left, scale(tick), right, scale(tick), "gridline");
    canvas->Text(left - 6, scale(tick) + 4, scale.Label(tick), "end", "m");
  }
  canvas->Line(left, top, left, bottom, "axis");
  canvas->Text(14, (top + bottom) / 2, label, "middle", {}, -90);
}

double DrawLegend(SvgCanvas* canvas, const std::vector<std::string>& names, const std::vector<int>& colours, double left,
                  double right, double top) {
  double x = left, y = top;
  for (size_t i = 0; i < names.size(); ++i) {
    const double width = 18 + TextWidth(names[i]) + 16;
    if (x > left && x + width > right) x = left, y += 18;
    if (canvas) {
      canvas->Rect(x, y + 3, 12, 10, FillClass(colours[i]));
      canvas->Text(x + 17, y + 12, names[i]);
    }
    x += width;
  }
  return names.empty() ? 0 : y - top + 20;
}

}  // namespace mvstudio::report
