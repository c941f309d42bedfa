#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/statistics.h"
#include "report/page/format.h"
#include "report/svg/axes.h"
#include "report/svg/canvas.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

constexpr double kTitleHeight = 22;
constexpr double kAxisHeight = 42;

std::vector<int> FirstColours(size_t count) {
  std::vector<int> colours(count);
  std::iota(colours.begin(), colours.end(), 0);
  return colours;
}

void DrawTitle(SvgCanvas* canvas, const std::string& title) { canvas->Text(2, 14, title, "start", "t"); }

std::vector<double> AllX(const LineChartSpec& spec) {
  std::vector<double> all;
  for (const LineSeries& series : spec.series) all.insert(all.end(), series.x.begin(), series.x.end());
  return all;
}

std::vector<double> AllY(const LineChartSpec& spec) {
  std::vector<double> all;
  for (const LineSeries& series : spec.series) all.insert(all.end(), series.y.begin(), series.y.end());
  return all;
}

double WidestLabel(const Scale& scale) {
  double widest = 0;
  for (const double tick : scale.ticks()) widest = std::max(widest, TextWidth(scale.Label(tick)));
  return widest;
}

void DrawMarkers(SvgCanvas* canvas, const std::vector<LineMarker>& markers, const Scale& x, double top, double bottom) {
  for (const LineMarker& marker : markers) {
    canvas->Line(x(marker.x), top, x(marker.x), bottom, "ref");
    canvas->Text(x(marker.x) + 4, top + 11, marker.label, "start", "m x halo");
  }
}

double WidestText(const std::vector<std::string>& labels) {
  double widest = 0;
  for (const std::string& label : labels) widest = std::max(widest, TextWidth(label));
  return widest;
}

std::vector<double> BarExtent(const BarChartSpec& spec) {
  std::vector<double> all;
  for (const BarSeries& series : spec.series) {
    for (size_t i = 0; i < series.values.size(); ++i) {
      const double sigma = i < series.sigma.size() && std::isfinite(series.sigma[i]) ? series.sigma[i] : 0;
      all.push_back(series.values[i]);
      if (sigma > 0) all.insert(all.end(), {series.values[i] - sigma, series.values[i] + sigma});
    }
  }
  if (spec.reference) all.push_back(*spec.reference);
  return all;
}

void DrawBar(SvgCanvas* canvas, const BarChartSpec& spec, size_t s, size_t i, const Scale& x, double y, double height) {
  const BarSeries& series = spec.series[s];
  const double value = i < series.values.size() ? series.values[i] : std::nan("");
  const double base = x(x.log() ? x.low() : 0.0);
  const std::string name = series.name.empty() ? "" : ", " + series.name;
  double end = base;
  if (std::isfinite(value)) {
    end = x(value);
    canvas->Rect(std::min(base, end), y, std::fabs(end - base), height, FillClass(static_cast<int>(s)),
                 spec.labels[i] + name + ": " + FormatNumber(value));
  }
  if (i < series.sigma.size() && std::isfinite(series.sigma[i]) && std::isfinite(value)) {
    const double low = x(value - series.sigma[i]), high = x(value + series.sigma[i]), middle = y + height / 2;
    canvas->Segments(
        {{{low, middle}, {high, middle}}, {{low, middle - 3}, {low, middle + 3}}, {{high, middle - 3}, {high, middle + 3}}},
        "err");
    end = std::max(end, high);
  }
  canvas->Text(std::max(end, base) + 5, y + height / 2 + 4, FormatNumber(value, 3), "start", "m x");
}

}  // namespace

std::string LineChart(const LineChartSpec& spec) {
  SvgCanvas canvas(spec.width, spec.height, spec.title);
  DrawTitle(&canvas, spec.title);
  std::vector<std::string> names;
  std::vector<int> colours;
  for (const LineSeries& series : spec.series) {
    colours.push_back(series.colour >= 0 ? series.colour : static_cast<int>(names.size()));
    names.push_back(series.name);
  }
  const bool legend = names.size() > 1;
  const double right = spec.width - 12, bottom = spec.height - kAxisHeight;
  const double top = kTitleHeight + 4 + (legend ? DrawLegend(nullptr, names, colours, 0, right, 0) : 0);
  const Scale y(spec.y, AllY(spec), bottom, top);
  const double left = 30 + std::max(18.0, WidestLabel(y));
  const Scale x(spec.x, AllX(spec), left, right);
  if (legend) DrawLegend(&canvas, names, colours, left, right, kTitleHeight);
  DrawLeftAxis(&canvas, y, spec.y.label + (y.log() ? ", log" : ""), left, right, top, bottom);
  DrawBottomAxis(&canvas, x, spec.x.label, left, right, top, bottom);
  DrawMarkers(&canvas, spec.markers, x, top, bottom);
  for (size_t s = 0; s < spec.series.size(); ++s) {
    const LineSeries& series = spec.series[s];
    std::vector<SvgCanvas::Point> points;
    for (size_t i = 0; i < std::min(series.x.size(), series.y.size()); ++i) points.emplace_back(x(series.x[i]), y(series.y[i]));
    if (points.size() == 1) canvas.Dots(points, StrokeClass(colours[s]), 5);
    canvas.Polyline(points, StrokeClass(colours[s]), 1.8, series.dashed);
  }
  return canvas.Finish();
}

std::string BarChart(const BarChartSpec& spec) {
  std::vector<std::string> names;
  for (const BarSeries& series : spec.series) names.push_back(series.name);
  const bool legend = names.size() > 1;
  const size_t count = std::max<size_t>(1, spec.series.size());
  const double bar = count == 1 ? 14 : 11, group = static_cast<double>(count) * bar + 7;
  const double left = std::min(spec.width * 0.45, 14 + WidestText(spec.labels)), right = spec.width - 52;
  const double legend_height = legend ? DrawLegend(nullptr, names, FirstColours(names.size()), left, spec.width, 0) : 0;
  const double top = kTitleHeight + legend_height + (spec.reference ? 16 : 2);
  const double bottom = top + group * static_cast<double>(spec.labels.size()) + 4;
  SvgCanvas canvas(spec.width, bottom + kAxisHeight, spec.title);
  DrawTitle(&canvas, spec.title);
  Axis axis = spec.value;
  axis.zero = true;
  const Scale x(axis, BarExtent(spec), left, right);
  if (legend) DrawLegend(&canvas, names, FirstColours(names.size()), left, spec.width, kTitleHeight);
  DrawBottomAxis(&canvas, x, spec.value.label, left, right, top, bottom);
  for (size_t i = 0; i < spec.labels.size(); ++i) {
    const double y = top + 5 + group * static_cast<double>(i);
    canvas.Text(left - 8, y + (group - 7) / 2 + 4, spec.labels[i], "end");
    for (size_t s = 0; s < spec.series.size(); ++s) DrawBar(&canvas, spec, s, i, x, y + bar * static_cast<double>(s), bar - 1);
  }
  if (spec.reference) {
    canvas.Line(x(*spec.reference), top, x(*spec.reference), bottom, "ref");
    canvas.Text(x(*spec.reference), top - 4, spec.reference_label, "middle", "m x");
  }
  return canvas.Finish();
}

std::string StackedBar(const std::string& title, const std::vector<StackPart>& parts, double width) {
  double total = 0;
  for (const StackPart& part : parts) total += std::isfinite(part.value) && part.value > 0 ? part.value : 0;
  std::vector<std::string> names;
  std::vector<int> colours;
  for (const StackPart& part : parts) {
    names.push_back(part.name + " " + FormatCount(part.value) + " (" +
                    FormatFixed(total > 0 ? 100 * part.value / total : 0, 1) + "%)");
    colours.push_back(part.colour);
  }
  const double top = kTitleHeight + 4, height = 24;
  SvgCanvas canvas(width, top + height + 10 + DrawLegend(nullptr, names, colours, 2, width, 0), title);
  DrawTitle(&canvas, title);
  double x = 2;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (!(parts[i].value > 0) || !std::isfinite(parts[i].value)) continue;
    const double length = (width - 4) * parts[i].value / total;
    canvas.Rect(x, top, length, height, FillClass(parts[i].colour), names[i]);
    x += length;
  }
  DrawLegend(&canvas, names, colours, 2, width, top + height + 6);
  return canvas.Finish();
}

std::string Histogram(const std::string& title, const Axis& value, const std::vector<double>& values, double width) {
  const std::vector<double> finite = FiniteValues(values);
  const double limit = LinearQuantile(finite, 0.99);
  const double high = std::isfinite(limit) && limit > 0 ? limit : 1, low = std::min(0.0, LinearQuantile(finite, 0));
  constexpr int kBins = 32;
  std::vector<double> counts(kBins, 0);
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    const double bin = (v - (std::isfinite(low) ? low : 0)) / (high - (std::isfinite(low) ? low : 0)) * kBins;
    ++counts[static_cast<size_t>(std::clamp(bin, 0.0, kBins - 1.0))];
  }
  const double left = 64, right = width - 14, top = kTitleHeight + 6, bottom = 240 - kAxisHeight;
  SvgCanvas canvas(width, 240, title);
  DrawTitle(&canvas, title);
  Axis count_axis;
  count_axis.zero = true;
  const Scale y(count_axis, counts, bottom, top);
  DrawLeftAxis(&canvas, y, "count", left, right, top, bottom);
  const double origin = std::isfinite(low) ? low : 0, bin_width = (high - origin) / kBins;
  const double pixels = (right - left) / kBins;
  for (int i = 0; i < kBins; ++i) {
    const std::string range = FormatNumber(origin + i * bin_width, 3) +
                              (i + 1 == kBins ? " and more" : " to " + FormatNumber(origin + (i + 1) * bin_width, 3));
    canvas.Rect(left + i * pixels + 0.5, y(counts[i]), pixels - 1, bottom - y(counts[i]), "f0",
                range + ": " + FormatCount(counts[i]));
  }
  const std::vector<double> ticks = NiceTicks(origin, high, 7);
  for (const double tick : ticks) {
    const std::string text = TickLabel(tick, ticks.size() > 1 ? ticks[1] - ticks[0] : 0);
    canvas.Text(left + (tick - origin) / (high - origin) * (right - left), bottom + 15, text, "middle", "m");
  }
  canvas.Line(left, bottom, right, bottom, "axis");
  canvas.Text((left + right) / 2, bottom + 32, value.label + " (last bin: all beyond)", "middle");
  return canvas.Finish();
}

std::string HeatMap(const HeatMapSpec& spec) {
  const double left = 14 + WidestText(spec.row_names), right = spec.width - 10, top = kTitleHeight + 4, row_height = 13;
  const double bottom = top + row_height * static_cast<double>(spec.rows.size());
  SvgCanvas canvas(spec.width, bottom + kAxisHeight, spec.title);
  DrawTitle(&canvas, spec.title);
  canvas.Rect(left, top, right - left, bottom - top, "frame");
  for (size_t r = 0; r < spec.rows.size(); ++r) {
    const double y = top + row_height * static_cast<double>(r);
    if (r < spec.row_names.size()) canvas.Text(left - 6, y + 10.5, spec.row_names[r], "end", "x");
    const std::vector<double>& cells = spec.rows[r];
    const double cell = (right - left) / static_cast<double>(std::max<size_t>(1, cells.size()));
    // Four shades; runs of one shade are one rectangle.
    const auto shade = [&](size_t i) {
      return std::isfinite(cells[i]) ? static_cast<int>(std::clamp(cells[i], 0.0, 1.0) * 4 + 0.5) : -1;
    };
    for (size_t i = 0; i < cells.size();) {
      size_t end = i + 1;
      while (end < cells.size() && shade(end) == shade(i)) ++end;
      const int level = shade(i);
      const char* const classes[] = {"f1", "h1", "h2", "h3", "h4"};
      if (level >= 0)
        canvas.Rect(left + cell * static_cast<double>(i), y + 1, cell * static_cast<double>(end - i), row_height - 2,
                    classes[level]);
      i = end;
    }
  }
  for (const double tick : NiceTicks(spec.first_column, spec.last_column, 8)) {
    // The label stands under the middle of its column.
    const double at = left + (tick - spec.first_column + 0.5) / (spec.last_column - spec.first_column + 1) * (right - left);
    canvas.Text(at, bottom + 15, FormatNumber(tick), "middle", "m");
  }
  canvas.Text((left + right) / 2, bottom + 32, spec.column_label, "middle");
  return canvas.Finish();
}

}  // namespace mvstudio::report
