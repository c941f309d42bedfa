#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// Figures as SVG text, each one well-formed element. Sizes are in CSS px; text is escaped here; values that are not
/// finite are omitted. Colours come from the page's style sheet (eight hues that colour-blind people can distinguish).
namespace mvstudio::report {

/// Multiples of 1, 2 or 5 times a power of ten that lie in [low, high], about `target` of them. Empty when the range is not
/// finite.
std::vector<double> NiceTicks(double low, double high, int target = 6);
/// Powers of ten in [low, high], and 2 and 5 times them when there are few; low > 0.
std::vector<double> LogTicks(double low, double high);
/// The tick's label with as many decimals as a tick distance of `step` needs; 0 for logarithmic ticks.
std::string TickLabel(double value, double step);
/// The largest of 1, 2, 5 times a power of ten that is not above `value` (> 0).
double NiceBelow(double value);

struct Axis {
  std::string label;  ///< with its unit: "loss (no unit)", "step", "error (mm)"
  bool log = false;   ///< falls back to linear when a value is not positive
  bool zero = false;  ///< the range includes 0
};

struct LineSeries {
  std::string name;
  std::vector<double> x, y;  ///< same length
  bool dashed = false;
  int colour = -1;  ///< palette index; -1: the series' place in the list
};
/// A named vertical line, e.g. at the start of a training phase.
struct LineMarker {
  double x = 0;
  std::string label;
};
struct LineChartSpec {
  std::string title;
  Axis x, y;
  std::vector<LineSeries> series;
  std::vector<LineMarker> markers;
  double width = 560, height = 300;
};
std::string LineChart(const LineChartSpec& spec);

struct BarSeries {
  std::string name;
  std::vector<double> values;  ///< one a label; NaN: no bar, drawn as a dash
  std::vector<double> sigma;   ///< half-length of the error bar; may be empty
};
/// Horizontal bars, grouped when there are several series.
struct BarChartSpec {
  std::string title;
  Axis value;
  std::vector<std::string> labels;
  std::vector<BarSeries> series;
  std::optional<double> reference;  ///< dashed line at a bound
  std::string reference_label;
  double width = 560;
};
std::string BarChart(const BarChartSpec& spec);

/// One bar divided into parts, with percentages; a part's `colour` is its palette index.
struct StackPart {
  std::string name;
  double value = 0;
  int colour = 0;
};
std::string StackedBar(const std::string& title, const std::vector<StackPart>& parts, double width = 760);

/// Counts of the finite `values` in equal bins up to their 99th percentile; larger values are in the last bin, which says
/// so.
std::string Histogram(const std::string& title, const Axis& value, const std::vector<double>& values, double width = 560);

/// A residual, observed minus projected, at an image point: x, y and dx, dy in px, y down.
struct ImageArrow {
  double x = 0, y = 0, dx = 0, dy = 0;
};
/// Residuals on the image plane, equal aspect, y down, enlarged by a round factor that the figure states.
std::string ResidualField(const std::string& title, double image_width_px, double image_height_px,
                          const std::vector<ImageArrow>& arrows, double width = 300);
/// The same residuals as points (dx, dy) about zero, equal aspect, y down, with their mean and the circle that contains 95
/// % of them.
std::string ResidualCloud(const std::string& title, const std::vector<ImageArrow>& arrows, double width = 240);

struct ImagePoint {
  double x = 0, y = 0;
};
/// Points of an image on the image itself: a ring where each was observed, and an arrow from its projection to it.
struct ImageOverlaySpec {
  std::string title;
  std::string_view image;  ///< PNG or JPEG; others leave the frame empty
  /// The part of the frame that the image shows and the figure covers, px: its left and top edge (-0.5 for all of it), size.
  double left_px = -0.5, top_px = -0.5, width_px = 0, height_px = 0;
  std::vector<ImageArrow> points;    ///< x, y observed; dx, dy observed minus projected
  std::vector<ImageArrow> rejected;  ///< a cross each
  std::vector<std::pair<ImagePoint, ImagePoint>> bones;
  bool enlarge = false;  ///< arrows by a round factor, stated below, away from the observed point
  double width = 420;
};
/// Empty without a size.
std::string ImageOverlay(const ImageOverlaySpec& spec);

/// One small target per camera with its mean residual (observed minus projected, px) as an arrow, all at one scale; those
/// above `suspect_px` are highlighted.
struct NamedVector {
  std::string name;
  double dx = 0, dy = 0;
};
std::string VectorTargets(const std::string& title, const std::vector<NamedVector>& vectors, double suspect_px,
                          double width = 900);

/// Heat map of fractions in [0, 1] (NaN: no value), darker is more.
struct HeatMapSpec {
  std::string title;
  std::string column_label;  ///< what runs along x, e.g. "frame"
  std::vector<std::string> row_names;
  double first_column = 0, last_column = 0;  ///< whole numbers that the columns cover
  std::vector<std::vector<double>> rows;     ///< one vector a row, all of one length
  double width = 760;
};
std::string HeatMap(const HeatMapSpec& spec);

/// Grid of numbers >= 0, darker is more, with the number in every cell that is large enough; struck out where there is none.
struct CellGridSpec {
  std::string title;
  std::vector<std::string> row_names, column_names;  ///< may be empty
  std::vector<std::vector<double>> rows;             ///< one vector a row, all of one length; NaN: nothing there
  double full = 0;                                   ///< the darkest shade's value; 0: the largest
  int decimals = 0;
  bool zero_is_missing = false;  ///< zeros stand out
  bool contours = false;         ///< lines of equal value and a scale of the shades instead of the numbers
  std::string unit = {};         ///< of the scale
  double aspect = 0.75;          ///< height of a cell over its width
  double width = 360;
};
std::string CellGrid(const CellGridSpec& spec);

/// How a method stands out: a ring around its dot, or a square in place of it.
enum class PointStyle { kDot, kRinged, kSquare };

/// Methods by cost and error; those on the Pareto front are connected and named.
struct ParetoPoint {
  std::string name;
  double cost = 0, error = 0;
  bool on_front = false;
  PointStyle style = PointStyle::kDot;  ///< others are named as well
};
struct ParetoChartSpec {
  std::string title;
  Axis cost, error;
  std::vector<ParetoPoint> points;
  double width = 760;
};
std::string ParetoChart(const ParetoChartSpec& spec);

}  // namespace mvstudio::report
