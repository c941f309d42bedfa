#include <algorithm>
#include <cmath>

#include "report/page/format.h"
#include "report/svg/canvas.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

constexpr double kTitle = 22, kLabel = 16;

double Largest(const std::vector<std::vector<double>>& rows) {
  double largest = 0;
  for (const auto& row : rows) {
    for (double value : row) {
      if (std::isfinite(value)) largest = std::max(largest, value);
    }
  }
  return largest;
}

double WidestName(const std::vector<std::string>& names) {
  double widest = 0;
  for (const std::string& name : names) widest = std::max(widest, TextWidth(name));
  return widest;
}

constexpr const char* kShades[] = {"h0", "h1", "h2", "h3", "h4"};
constexpr int kNumShades = 5;

/// Cells of a grid on the canvas.
struct Layout {
  double left, top, width, height;  ///< of the grid's corner and of one cell

  SvgCanvas::Point Middle(size_t row, size_t column) const {
    return {left + width * (static_cast<double>(column) + 0.5), top + height * (static_cast<double>(row) + 0.5)};
  }
};

/// Where a field that is linear between the cells' middles crosses `level` (marching squares).
std::vector<std::pair<SvgCanvas::Point, SvgCanvas::Point>> ContourOf(const std::vector<std::vector<double>>& rows, double level,
                                                                     const Layout& layout) {
  std::vector<std::pair<SvgCanvas::Point, SvgCanvas::Point>> segments;
  for (size_t r = 0; r + 1 < rows.size(); ++r) {
    for (size_t c = 0; c + 1 < rows[r].size(); ++c) {
      const double values[] = {rows[r][c], rows[r][c + 1], rows[r + 1][c + 1], rows[r + 1][c]};
      const SvgCanvas::Point places[] = {layout.Middle(r, c), layout.Middle(r, c + 1), layout.Middle(r + 1, c + 1),
                                         layout.Middle(r + 1, c)};
      std::vector<SvgCanvas::Point> cuts;
      for (size_t k = 0; k < 4; ++k) {
        const double a = values[k], b = values[(k + 1) % 4], share = (level - a) / (b - a);
        const SvgCanvas::Point &from = places[k], &to = places[(k + 1) % 4];
        if ((a < level) == (b < level) || !std::isfinite(share)) continue;
        cuts.emplace_back(from.first + share * (to.first - from.first), from.second + share * (to.second - from.second));
      }
      for (size_t k = 0; k + 1 < cuts.size(); k += 2) segments.emplace_back(cuts[k], cuts[k + 1]);
    }
  }
  return segments;
}

/// Lines of 1, 2 and 5 times powers of ten, each with its value.
void DrawContours(SvgCanvas* canvas, const CellGridSpec& spec, const Layout& layout) {
  double low = Largest(spec.rows);
  for (const auto& row : spec.rows) {
    for (const double value : row) low = std::isfinite(value) && value > 0 ? std::min(low, value) : low;
  }
  for (const double level : LogTicks(low, Largest(spec.rows))) {
    const auto segments = ContourOf(spec.rows, level, layout);
    if (segments.empty()) continue;
    canvas->Segments(segments, "err", 1.2);
    const SvgCanvas::Point& at = segments[segments.size() / 2].first;
    canvas->Text(at.first, at.second + 4, FormatNumber(level), "middle", "x halo");
  }
}

/// The shades with the values at which they begin.
void DrawShades(SvgCanvas* canvas, double left, double top, double full, const std::string& unit) {
  constexpr double kWidth = 44, kHeight = 10;
  for (int i = 0; i < kNumShades; ++i) {
    canvas->Rect(left + i * kWidth, top, kWidth, kHeight, kShades[i]);
    canvas->Text(left + i * kWidth, top + kHeight + 11, FormatNumber(full * i / kNumShades), i == 0 ? "start" : "middle", "x");
  }
  canvas->Text(left + kNumShades * kWidth + 6, top + kHeight, unit, "start", "x");
}

}  // namespace

std::string CellGrid(const CellGridSpec& spec) {
  const size_t rows = spec.rows.size(), cols = rows ? spec.rows[0].size() : 0;
  const double left = spec.row_names.empty() ? 4 : 10 + WidestName(spec.row_names);
  const double cell_width = (spec.width - left - 4) / static_cast<double>(std::max<size_t>(1, cols));
  const double cell_height = std::clamp(cell_width * spec.aspect, 14.0, 30.0);
  const double top = kTitle + (spec.column_names.empty() ? 4 : kLabel + 4);
  const double bottom = top + cell_height * static_cast<double>(rows), scale_height = spec.contours ? 32 : 4;
  const Layout layout{left, top, cell_width, cell_height};
  SvgCanvas canvas(spec.width, bottom + scale_height, spec.title);
  canvas.Text(0, 14, spec.title, "start", "t");
  canvas.Rect(left, top, cell_width * static_cast<double>(cols), cell_height * static_cast<double>(rows), "frame");
  const double full = spec.full > 0 ? spec.full : Largest(spec.rows);
  for (size_t r = 0; r < rows; ++r) {
    const double y = top + cell_height * static_cast<double>(r);
    if (r < spec.row_names.size()) canvas.Text(left - 6, y + cell_height / 2 + 4, spec.row_names[r], "end", "x");
    for (size_t c = 0; c < cols; ++c) {
      const double x = left + cell_width * static_cast<double>(c), value = spec.rows[r][c];
      const std::string text = std::isfinite(value) ? FormatFixed(value, spec.decimals) : kNoNumber;
      const bool missing = spec.zero_is_missing && value == 0;
      if (!std::isfinite(value)) {
        canvas.Line(x + 0.5, y + cell_height - 0.5, x + cell_width - 0.5, y + 0.5, "axis");
      } else if (missing || value > 0) {
        const int level = full > 0 ? static_cast<int>(std::clamp(value / full, 0.0, 1.0) * kNumShades) : 0;
        canvas.Rect(x + 0.5, y + 0.5, cell_width - 1, cell_height - 1,
                    missing ? "f1" : kShades[std::min(level, kNumShades - 1)], text);
      }
      if (!spec.contours && cell_width > TextWidth(text) + 2)
        canvas.Text(x + cell_width / 2, y + cell_height / 2 + 4, text, "middle", "x");
    }
  }
  if (spec.contours) {
    DrawContours(&canvas, spec, layout);
    DrawShades(&canvas, left, bottom + 5, full, spec.unit);
  }
  for (size_t c = 0; c < std::min(cols, spec.column_names.size()); ++c)
    canvas.Text(left + cell_width * (static_cast<double>(c) + 0.5), top - 5, spec.column_names[c], "middle", "x");
  return canvas.Finish();
}

}  // namespace mvstudio::report
