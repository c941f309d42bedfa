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

}  // namespace

std::string CellGrid(const CellGridSpec& spec) {
  const size_t rows = spec.rows.size(), cols = rows ? spec.rows[0].size() : 0;
  const double left = spec.row_names.empty() ? 4 : 10 + WidestName(spec.row_names);
  const double cell_width = (spec.width - left - 4) / static_cast<double>(std::max<size_t>(1, cols));
  const double cell_height = std::clamp(cell_width * spec.aspect, 14.0, 30.0);
  const double top = kTitle + (spec.column_names.empty() ? 4 : kLabel + 4);
  SvgCanvas canvas(spec.width, top + cell_height * static_cast<double>(rows) + 4, spec.title);
  canvas.Text(0, 14, spec.title, "start", "t");
  canvas.Rect(left, top, cell_width * static_cast<double>(cols), cell_height * static_cast<double>(rows), "frame");
  const double full = spec.full > 0 ? spec.full : Largest(spec.rows);
  static const char* const kShades[] = {"f1", "h1", "h2", "h3", "h4"};
  for (size_t r = 0; r < rows; ++r) {
    const double y = top + cell_height * static_cast<double>(r);
    if (r < spec.row_names.size()) canvas.Text(left - 6, y + cell_height / 2 + 4, spec.row_names[r], "end", "x");
    for (size_t c = 0; c < cols; ++c) {
      const double x = left + cell_width * static_cast<double>(c), value = spec.rows[r][c];
      const std::string text = std::isfinite(value) ? FormatFixed(value, spec.decimals) : kNoNumber;
      if (std::isfinite(value)) {
        const int level = full > 0 ? static_cast<int>(std::clamp(value / full, 0.0, 1.0) * 4 + 0.5) : 0;
        const bool missing = spec.zero_is_missing && value == 0;
        if (missing || level > 0) canvas.Rect(x + 0.5, y + 0.5, cell_width - 1, cell_height - 1, kShades[missing ? 0 : level], text);
      }
      if (cell_width > TextWidth(text) + 2) canvas.Text(x + cell_width / 2, y + cell_height / 2 + 4, text, "middle", "x");
    }
  }
  for (size_t c = 0; c < std::min(cols, spec.column_names.size()); ++c)
    canvas.Text(left + cell_width * (static_cast<double>(c) + 0.5), top - 5, spec.column_names[c], "middle", "x");
  return canvas.Finish();
}

}  // namespace mvstudio::report
