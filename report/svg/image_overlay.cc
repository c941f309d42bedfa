#include <algorithm>
#include <cmath>

#include "core/statistics.h"
#include "report/page/format.h"
#include "report/svg/canvas.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

using Segment = std::pair<SvgCanvas::Point, SvgCanvas::Point>;

constexpr double kTop = 22, kFoot = 22, kRing = 5;

/// From pixels of the frame to the canvas.
struct Placement {
  double left_px, top_px, scale;

  SvgCanvas::Point operator()(double x, double y) const { return {(x - left_px) * scale, kTop + (y - top_px) * scale}; }
};

/// A round factor that makes a long residual a twentieth of the figure's width; 1 without residuals.
double FactorOf(const ImageOverlaySpec& spec) {
  std::vector<double> lengths;
  for (const ImageArrow& a : spec.points) lengths.push_back(std::hypot(a.dx, a.dy));
  const double typical = LinearQuantile(FiniteValues(lengths), 0.95);
  return spec.enlarge && typical > 0 ? std::max(1.0, NiceBelow(0.05 * spec.width_px / typical)) : 1;
}

void DrawBones(const ImageOverlaySpec& spec, const Placement& at, SvgCanvas* canvas) {
  std::vector<Segment> bones;
  for (const auto& [a, b] : spec.bones) bones.push_back({at(a.x, a.y), at(b.x, b.y)});
  canvas->Segments(bones, "over-edge", 4);
  canvas->Segments(bones, "over-bone", 2);
}

/// Everything twice, wide and dark below narrow and bright, so that it is seen on any image.
void DrawRings(const ImageOverlaySpec& spec, const Placement& at, SvgCanvas* canvas) {
  std::vector<SvgCanvas::Point> centres;
  for (const ImageArrow& a : spec.points) centres.push_back(at(a.x, a.y));
  canvas->Rings(centres, "over-edge", kRing, 3.2);
  canvas->Rings(centres, "over-ring", kRing, 1.6);
}

void DrawResiduals(const ImageOverlaySpec& spec, const Placement& at, double factor, SvgCanvas* canvas) {
  std::vector<Segment> needles, crosses;
  for (const ImageArrow& a : spec.points) {
    const auto foot = spec.enlarge ? at(a.x, a.y) : at(a.x - a.dx, a.y - a.dy);
    needles.push_back({foot, {foot.first + factor * a.dx * at.scale, foot.second + factor * a.dy * at.scale}});
  }
  for (const ImageArrow& a : spec.rejected) {
    const auto [x, y] = at(a.x, a.y);
    crosses.push_back({{x - kRing, y - kRing}, {x + kRing, y + kRing}});
    crosses.push_back({{x - kRing, y + kRing}, {x + kRing, y - kRing}});
  }
  canvas->Segments(needles, "over-edge", 3.4);
  canvas->Segments(needles, "over-needle", 1.6);
  canvas->Segments(crosses, "over-edge", 3.4);
  canvas->Segments(crosses, "over-cross", 1.8);
}

}  // namespace

std::string ImageOverlay(const ImageOverlaySpec& spec) {
  if (!(spec.width_px > 0) || !(spec.height_px > 0)) return {};
  const double scale = spec.width / spec.width_px, height = spec.height_px * scale;
  if (!(height < 1e4)) return {};
  const Placement at{spec.left_px, spec.top_px, scale};
  SvgCanvas canvas(spec.width, kTop + height + (spec.enlarge ? kFoot : 0), spec.title);
  canvas.Text(2, 14, spec.title, "start", "t");
  canvas.Rect(0, kTop, spec.width, height, "frame");
  canvas.BeginClip(0, kTop, spec.width, height);
  canvas.EmbedImage(0, kTop, spec.width, height, spec.image);
  const double factor = FactorOf(spec);
  DrawBones(spec, at, &canvas);
  DrawRings(spec, at, &canvas);
  DrawResiduals(spec, at, factor, &canvas);
  canvas.EndClip();
  if (spec.enlarge) {
    canvas.Text(spec.width - 2, kTop + height + 15, "arrows enlarged \u00d7" + FormatNumber(factor), "end", "m x");
  }
  return canvas.Finish();
}

}  // namespace mvstudio::report
