#include <algorithm>
#include <cmath>

#include "core/statistics.h"
#include "report/page/format.h"
#include "report/page/html.h"
#include "report/sections.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

std::vector<std::vector<double>> ReadRows(const Value& list) {
  std::vector<std::vector<double>> rows;
  for (const Value& row : list.items()) {
    rows.emplace_back();
    for (const Value& value : row.items()) rows.back().push_back(value.Number());
    if (rows.back().size() != rows.front().size()) return {};
  }
  return rows;
}

std::string SelectionTable(const Value& rows) {
  if (rows.items().empty()) return {};
  Table table("Lenses that were compared on held-out boards");
  table.AddColumn("camera", "", false);
  table.AddColumn("lens", "", false);
  table.AddColumn("numbers");
  table.AddColumn("held-out rms", "px");
  table.AddColumn("median", "px");
  table.AddColumn("beyond 5 px", "%");
  for (const Value& row : rows.items()) {
    const bool chosen = row["chosen"].Flag();
    table.AddRow({row["camera"].Text("?"), Table::Cell(row["model"].Text("?") + (chosen ? " (chosen)" : ""), chosen),
                  FormatNumber(row["num_params"].Number()), FormatFixed(row["holdout_rms_px"].Number(), 4),
                  FormatFixed(row["holdout_median_px"].Number(), 4), FormatFixed(100 * row["gross_fraction"].Number(), 2)},
                 chosen);
  }
  return DetailsHtml("Lenses that were compared", table.Html());
}

/// What the darkest shade of all cameras' maps stands for, px: a round number above all that they hold, at most 1.
double MapScale(const Value& cameras) {
  double largest = 0;
  for (const Value& camera : cameras.items()) {
    for (const auto& row : ReadRows(camera["uncertainty_map_px"])) {
      for (const double value : row) largest = std::isfinite(value) ? std::max(largest, value) : largest;
    }
  }
  return largest > 0 ? std::min(1.0, NiceBelow(2.5 * largest)) : 1;
}

/// What cells without a number are, where there are any.
std::string StruckOut(const std::vector<std::vector<double>>& rows) {
  for (const auto& row : rows) {
    if (FiniteValues(row).size() < row.size()) return "; struck out where the calibration gives no number";
  }
  return {};
}

std::string CameraMaps(const Value& metrics) {
  std::vector<std::string> figures;
  const double scale = MapScale(metrics["cameras"]);
  for (const Value& camera : metrics["cameras"].items()) {
    CellGridSpec spec;
    spec.title = camera["name"].Text("?") + ": corners over the image";
    spec.rows = ReadRows(camera["coverage_cells"]);
    spec.zero_is_missing = true;
    if (!spec.rows.empty()) figures.push_back(FigureHtml(CellGrid(spec), "Cells without a corner stand out: film there."));
    CellGridSpec map;
    map.title = camera["name"].Text("?") + ": uncertainty over the image (px)";
    map.rows = ReadRows(camera["uncertainty_map_px"]);
    map.decimals = scale < 0.5 ? 3 : 2;
    map.full = scale;
    map.width = 440;
    map.contours = true;
    map.unit = "px";
    if (!map.rows.empty()) {
      figures.push_back(FigureHtml(CellGrid(map),
                                   "Standard deviation of a projection along its worst direction, at the median distance of "
                                   "the boards, with lines of equal deviation. The darkest shade holds all from " +
                                       FormatNumber(0.8 * scale) + " px on" + StruckOut(map.rows) + "."));
    }
  }
  return CameraFigures("Maps over the image", "", figures, metrics["cameras"].items().size());
}

}  // namespace

std::string Covisibility(const Value& metrics) {
  CellGridSpec spec;
  spec.title = "Time steps in which two cameras saw a board";
  spec.rows = ReadRows(metrics["covisibility"]);
  if (spec.rows.size() < 2 || spec.rows.size() > 60) return {};
  for (const Value& camera : metrics["cameras"].items()) spec.row_names.push_back(camera["name"].Text("?"));
  if (spec.rows.size() <= 12) spec.column_names = spec.row_names;
  spec.zero_is_missing = true;
  spec.aspect = 0.4;
  spec.width = spec.rows.size() <= 8 ? 460 : 760;
  return FigureHtml(CellGrid(spec),
                    "On the diagonal, the time steps of one camera alone. The rig holds together along the pairs with many.");
}

std::string CaptureAdvice(const Value& hints) {
  if (hints.items().empty()) return {};
  constexpr size_t kMostOpen = 2;  // the most useful come first
  std::string open, folded;
  for (size_t i = 0; i < hints.items().size(); ++i)
    (i < kMostOpen ? open : folded) += ParagraphHtml(hints.At(i)["text"].Text());
  if (!folded.empty()) folded = DetailsHtml(std::to_string(hints.items().size() - kMostOpen) + " more", folded);
  return "<h3>What to film next</h3>\n" + open + folded;
}

std::string CameraFigures(const std::string& heading, const std::string& text, const std::vector<std::string>& figures,
                          size_t num_cameras, const char* css_class) {
  constexpr size_t kMostOpen = 4;
  if (figures.empty()) return {};
  const std::string body = (text.empty() ? "" : ParagraphHtml(text, "muted")) + GridHtml(figures, css_class);
  if (num_cameras > kMostOpen) return DetailsHtml(heading + " of " + std::to_string(num_cameras) + " cameras", body);
  return "<h3>" + EscapeHtml(heading) + "</h3>\n" + body;
}

std::string CalibrationMaps(const Value& metrics) { return SelectionTable(metrics["model_selection"]) + CameraMaps(metrics); }

}  // namespace mvstudio::report
