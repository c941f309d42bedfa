#include <algorithm>
#include <cmath>

#include "core/statistics.h"
#include "report/page/format.h"
#include "report/svg/axes.h"
#include "report/svg/canvas.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

constexpr double kTitleHeight = 22;

bool IsFinite(const ImageArrow& a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.dx) && std::isfinite(a.dy);
}

std::vector<ImageArrow> FiniteOnly(const std::vector<ImageArrow>& arrows) {
  std::vector<ImageArrow> kept;
  std::copy_if(arrows.begin(), arrows.end(), std::back_inserter(kept), IsFinite);
  return kept;
}

std::vector<double> Lengths(const std::vector<ImageArrow>& arrows) {
  std::vector<double> lengths;
  for (const ImageArrow& a : arrows) lengths.push_back(std::hypot(a.dx, a.dy));
  return lengths;
}

/// Edges of the image with their pixel coordinates; y grows downwards.
void DrawImageFrame(SvgCanvas* canvas, double left, double top, double scale, double width_px, double height_px) {
  const double right = left + width_px * scale, bottom = top + height_px * scale;
  canvas->Rect(left, top, right - left, bottom - top, "frame");
  for (const double tick : NiceTicks(0, width_px, 4)) {
    canvas->Line(left + tick * scale, bottom, left + tick * scale, bottom + 4, "axis");
    canvas->Text(left + tick * scale, bottom + 16, FormatNumber(tick), "middle", "m x");
  }
  for (const double tick : NiceTicks(0, height_px, 4)) {
    canvas->Line(left - 4, top + tick * scale, left, top + tick * scale, "axis");
    canvas->Text(left - 7, top + tick * scale + 4, FormatNumber(tick), "end", "m x");
  }
  canvas->Text((left + right) / 2, bottom + 30, "image x (px)", "middle", "x");
  canvas->Text(11, (top + bottom) / 2, "image y (px)", "middle", "x", -90);
}

void DrawScaleKey(SvgCanvas* canvas, double x, double y, double key_px, double length) {
  canvas->Segments({{{x, y}, {x + length, y}}, {{x, y - 4}, {x, y + 4}}, {{x + length, y - 4}, {x + length, y + 4}}}, "err",
                   1.5);
  canvas->Text(x + length + 6, y + 4, FormatNumber(key_px) + "\u00a0px", "start", "x");
}

struct Target {
  double x, y, radius, scale;  // centre and size on the canvas; canvas px per image px
};

void DrawTarget(SvgCanvas* canvas, const Target& target, const NamedVector& vector, double ring_px, bool suspect) {
  canvas->Circle(target.x, target.y, target.radius, "frame");
  canvas->Circle(target.x, target.y, ring_px * target.scale, "gridline");
  canvas->Line(target.x - target.radius, target.y, target.x + target.radius, target.y, "gridline");
  canvas->Line(target.x, target.y - target.radius, target.x, target.y + target.radius, "gridline");
  canvas->Arrow(target.x, target.y, target.x + vector.dx * target.scale, target.y + vector.dy * target.scale, suspect ? 1 : 0,
                2.2);
  canvas->Text(target.x, target.y + target.radius + 16, vector.name, "middle", suspect ? "t" : "");
  const double size = std::hypot(vector.dx, vector.dy);
  canvas->Text(target.x, target.y + target.radius + 31, FormatWithUnit(size, "px", 3), "middle", suspect ? "t" : "m");
}

}  // namespace

std::string ResidualField(const std::string& title, double image_width_px, double image_height_px,
                          const std::vector<ImageArrow>& arrows, double width) {
  const std::vector<ImageArrow> kept = FiniteOnly(arrows);
  const double left = 52, top = kTitleHeight + 2;
  const bool sized = image_width_px > 0 && image_height_px > 0;
  const double scale = (width - left - 14) / (sized ? image_width_px : 1);
  const double plot_height = (sized ? image_height_px : 0.75) * scale;
  SvgCanvas canvas(width, top + plot_height + 62, title);
  canvas.Text(2, 14, title, "start", "t");
  DrawImageFrame(&canvas, left, top, scale, sized ? image_width_px : 1, sized ? image_height_px : 0.75);
  const double typical = LinearQuantile(FiniteValues(Lengths(kept)), 0.95);
  const double factor = typical > 0 ? NiceBelow(0.09 * std::max(image_width_px, image_height_px) / typical) : 1;
  std::vector<std::pair<SvgCanvas::Point, SvgCanvas::Point>> needles;
  std::vector<SvgCanvas::Point> feet;
  for (const ImageArrow& a : kept) {
    const SvgCanvas::Point foot{left + a.x * scale, top + a.y * scale};
    needles.push_back({foot, {foot.first + a.dx * factor * scale, foot.second + a.dy * factor * scale}});
    feet.push_back(foot);
  }
  canvas.BeginClip(left, top, width - left - 14, plot_height);
  canvas.Segments(needles, "s0", 1.1);
  canvas.Dots(feet, "s1", 2.6);
  canvas.EndClip();
  const double key_px = typical > 0 ? NiceBelow(2.2 * typical) : 1;
  const double y = top + plot_height + 50;
  DrawScaleKey(&canvas, left, y, key_px, key_px * factor * scale);
  canvas.Text(width - 14, y + 4, "enlarged \u00d7" + FormatNumber(factor), "end", "m x");
  return canvas.Finish();
}

std::string ResidualCloud(const std::string& title, const std::vector<ImageArrow>& arrows, double width) {
  const std::vector<ImageArrow> kept = FiniteOnly(arrows);
  const double side = width - 66, left = 52, top = kTitleHeight + 2, centre_x = left + side / 2, centre_y = top + side / 2;
  SvgCanvas canvas(width, top + side + 44, title);
  canvas.Text(2, 14, title, "start", "t");
  const double circle = LinearQuantile(FiniteValues(Lengths(kept)), 0.95);
  const double reach = circle > 0 ? 1.6 * circle : 1, scale = side / 2 / reach;
  canvas.Rect(left, top, side, side, "frame");
  const std::vector<double> ticks = NiceTicks(-reach, reach, 4);
  const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 0;
  for (const double tick : ticks) {
    canvas.Line(centre_x + tick * scale, top, centre_x + tick * scale, top + side, "gridline");
    canvas.Line(left, centre_y + tick * scale, left + side, centre_y + tick * scale, "gridline");
    canvas.Text(centre_x + tick * scale, top + side + 15, TickLabel(tick, step), "middle", "m x");
    canvas.Text(left - 5, centre_y + tick * scale + 4, TickLabel(tick, step), "end", "m x");
  }
  std::vector<SvgCanvas::Point> points;
  double mean_x = 0, mean_y = 0;
  for (const ImageArrow& a : kept) {
    points.emplace_back(centre_x + a.dx * scale, centre_y + a.dy * scale);
    mean_x += a.dx / static_cast<double>(kept.size());
    mean_y += a.dy / static_cast<double>(kept.size());
  }
  canvas.BeginClip(left, top, side, side);
  canvas.Dots(points, "s0 faint", 3);
  if (circle > 0) canvas.Circle(centre_x, centre_y, circle * scale, "ref");
  const double x = centre_x + mean_x * scale, y = centre_y + mean_y * scale;
  canvas.Segments({{{x - 6, y}, {x + 6, y}}, {{x, y - 6}, {x, y + 6}}}, "s1", 2.5);
  canvas.EndClip();
  canvas.Text(centre_x, top + side + 32, "dx (px)", "middle", "x");
  canvas.Text(11, centre_y, "dy (px), down", "middle", "x", -90);
  return canvas.Finish();
}

std::string VectorTargets(const std::string& title, const std::vector<NamedVector>& vectors, double suspect_px, double width) {
  double longest = 0;
  for (const NamedVector& v : vectors) {
    if (std::isfinite(v.dx) && std::isfinite(v.dy)) longest = std::max(longest, std::hypot(v.dx, v.dy));
  }
  const double cell = 108, cell_height = 134, radius = 42;
  const int columns = std::max(1, static_cast<int>((width - 4) / cell));
  const int rows = (static_cast<int>(vectors.size()) + columns - 1) / columns;
  SvgCanvas canvas(width, kTitleHeight + rows * cell_height + 24, title);
  canvas.Text(2, 14, title, "start", "t");
  const double ring = longest > 0 ? NiceBelow(longest) : 1;
  const double scale = radius / std::max(ring, longest * 1.05);
  for (size_t i = 0; i < vectors.size(); ++i) {
    const double x = (static_cast<double>(i % columns) + 0.5) * cell,
                 y = kTitleHeight + 6 + radius + static_cast<double>(i / columns) * cell_height;
    DrawTarget(&canvas, {x, y, radius, scale}, vectors[i], ring, std::hypot(vectors[i].dx, vectors[i].dy) > suspect_px);
  }
  canvas.Text(4, kTitleHeight + rows * cell_height + 14, "inner ring: " + FormatNumber(ring) + "\u00a0px; image axes, y down",
              "start", "m x");
  return canvas.Finish();
}

}  // namespace mvstudio::report
