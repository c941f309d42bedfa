#include "report/svg/canvas.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "core/format.h"
#include "core/join.h"
#include "report/page/html.h"
#include "report/page/image.h"

namespace mvstudio::report {
namespace {

/// Two decimals at most, no trailing zeros.
std::string Coordinate(double value) {
  std::string text = Format("%.2f", std::clamp(value, -1e6, 1e6));
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

bool AllFinite(std::initializer_list<double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

bool IsFinite(const SvgCanvas::Point& p) { return std::isfinite(p.first) && std::isfinite(p.second); }

std::string Attribute(const char* name, double value) { return std::string(" ") + name + "=\"" + Coordinate(value) + "\""; }

std::string ClassAttribute(const std::string& css_class) {
  return css_class.empty() ? "" : " class=\"" + EscapeHtml(css_class) + "\"";
}

std::string CloseWithTooltip(const char* tag, const std::string& tooltip) {
  if (tooltip.empty()) return "/>\n";
  return "><title>" + EscapeHtml(tooltip) + "</title></" + tag + ">\n";
}

std::string Pair(const SvgCanvas::Point& p) { return Coordinate(p.first) + " " + Coordinate(p.second); }

}  // namespace

void SvgCanvas::Line(double x1, double y1, double x2, double y2, const std::string& css_class, double stroke_width) {
  if (!AllFinite({x1, y1, x2, y2})) return;
  body_ += "<line" + Attribute("x1", x1) + Attribute("y1", y1) + Attribute("x2", x2) + Attribute("y2", y2) +
           ClassAttribute(css_class) + Attribute("stroke-width", stroke_width) + "/>\n";
}

void SvgCanvas::Rect(double x, double y, double width, double height, const std::string& css_class,
                     const std::string& tooltip) {
  if (!AllFinite({x, y, width, height}) || width < 0 || height < 0) return;
  body_ += "<rect" + Attribute("x", x) + Attribute("y", y) + Attribute("width", width) + Attribute("height", height) +
           ClassAttribute(css_class) + CloseWithTooltip("rect", tooltip);
}

void SvgCanvas::Circle(double x, double y, double radius, const std::string& css_class, const std::string& tooltip) {
  if (!AllFinite({x, y, radius}) || radius < 0) return;
  body_ += "<circle" + Attribute("cx", x) + Attribute("cy", y) + Attribute("r", radius) + ClassAttribute(css_class) +
           CloseWithTooltip("circle", tooltip);
}

void SvgCanvas::EmbedImage(double x, double y, double width, double height, std::string_view bytes) {
  if (!AllFinite({x, y, width, height}) || width < 0 || height < 0 || ImageType(bytes).empty()) return;
  body_ += "<image" + Attribute("x", x) + Attribute("y", y) + Attribute("width", width) + Attribute("height", height) +
           " preserveAspectRatio=\"none\" href=\"" + ImageUri(bytes) + "\"/>\n";
}

void SvgCanvas::Text(double x, double y, const std::string& text, const std::string& anchor, const std::string& css_class,
                     double rotate_deg) {
  if (!AllFinite({x, y, rotate_deg})) return;
  body_ += "<text" + Attribute("x", x) + Attribute("y", y) + ClassAttribute(css_class);
  if (anchor != "start") body_ += " text-anchor=\"" + EscapeHtml(anchor) + "\"";
  if (rotate_deg != 0) {
    body_ += " transform=\"rotate(" + Coordinate(rotate_deg) + " " + Pair({x, y}) + ")\"";
  }
  body_ += ">" + EscapeHtml(text) + "</text>\n";
}

void SvgCanvas::Polyline(const std::vector<Point>& points, const std::string& css_class, double stroke_width, bool dashed) {
  std::string path;
  bool pen_down = false;
  for (const Point& point : points) {
    if (!IsFinite(point)) {
      pen_down = false;
      continue;
    }
    path += (pen_down ? "L" : "M") + Pair(point);
    pen_down = true;
  }
  if (path.empty()) return;
  body_ += "<path d=\"" + path + "\"" + ClassAttribute(css_class) + Attribute("stroke-width", stroke_width) +
           " stroke-linejoin=\"round\"" + (dashed ? " stroke-dasharray=\"5 3\"" : "") + "/>\n";
}

void SvgCanvas::Polygon(const std::vector<Point>& points, const std::string& css_class, double stroke_width) {
  if (points.size() < 3 || !std::all_of(points.begin(), points.end(), IsFinite)) return;
  body_ += "<polygon points=\"" + Join(points, " ", Pair) + "\"" + ClassAttribute(css_class) +
           Attribute("stroke-width", stroke_width) + "/>\n";
}

void SvgCanvas::Segments(const std::vector<std::pair<Point, Point>>& segments, const std::string& css_class,
                         double stroke_width, const std::string& colour) {
  std::string path;
  for (const auto& [from, to] : segments) {
    if (IsFinite(from) && IsFinite(to)) path += "M" + Pair(from) + "L" + Pair(to);
  }
  if (path.empty()) return;
  body_ += "<path d=\"" + path + "\"" + ClassAttribute(css_class) + Attribute("stroke-width", stroke_width);
  if (!colour.empty()) body_ += " style=\"stroke:" + EscapeHtml(colour) + "\"";
  body_ += "/>\n";
}

void SvgCanvas::Dots(const std::vector<Point>& points, const std::string& css_class, double diameter) {
  std::string path;
  for (const Point& point : points) {
    if (IsFinite(point)) path += "M" + Pair(point) + "h0";
  }
  if (path.empty()) return;
  body_ += "<path d=\"" + path + "\"" + ClassAttribute(css_class + " dots") + Attribute("stroke-width", diameter) + "/>\n";
}

void SvgCanvas::Rings(const std::vector<Point>& centres, const std::string& css_class, double radius, double stroke_width) {
  const std::string arc = "a" + Pair({radius, radius}) + " 0 1 0 ", across = Coordinate(2 * radius);
  std::string path;
  for (const Point& centre : centres) {
    if (!IsFinite(centre)) continue;
    path += "M" + Pair({centre.first - radius, centre.second}) + arc + across + " 0" + arc + "-" + across + " 0";
  }
  if (path.empty()) return;
  body_ += "<path d=\"" + path + "\"" + ClassAttribute(css_class) + Attribute("stroke-width", stroke_width) + "/>\n";
}

void SvgCanvas::Arrow(double x1, double y1, double x2, double y2, int colour, double stroke_width) {
  const double dx = x2 - x1, dy = y2 - y1, length = std::hypot(dx, dy);
  if (!AllFinite({x1, y1, x2, y2}) || length <= 0) return;
  const double head = std::min(length, 3.5 * stroke_width), ux = dx / length, uy = dy / length, half = 0.45 * head;
  const double base_x = x2 - head * ux, base_y = y2 - head * uy;
  Line(x1, y1, base_x, base_y, StrokeClass(colour), stroke_width);
  Polygon({{x2, y2}, {base_x - half * uy, base_y + half * ux}, {base_x + half * uy, base_y - half * ux}}, FillClass(colour), 0);
}

void SvgCanvas::BeginClip(double x, double y, double width, double height) {
  body_ += "<svg" + Attribute("x", x) + Attribute("y", y) + Attribute("width", width) + Attribute("height", height) +
           " viewBox=\"" + Pair({x, y}) + " " + Pair({width, height}) + "\" overflow=\"hidden\">\n";
}

void SvgCanvas::EndClip() { body_ += "</svg>\n"; }

std::string SvgCanvas::Finish() const {
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" aria-label=\"" + EscapeHtml(title_) + "\"" +
         Attribute("width", width_) + Attribute("height", height_) + " viewBox=\"0 0 " + Pair({width_, height_}) + "\">\n" +
         body_ + "</svg>\n";
}

double TextWidth(const std::string& text) {
  const auto is_start = [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; };
  return 6.9 * static_cast<double>(std::count_if(text.begin(), text.end(), is_start));
}

std::string StrokeClass(int colour) { return "s" + std::to_string(((colour % 8) + 8) % 8); }
std::string FillClass(int colour) { return "f" + std::to_string(((colour % 8) + 8) % 8); }

}  // namespace mvstudio::report
