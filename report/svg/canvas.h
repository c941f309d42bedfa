#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mvstudio::report {

/// An SVG figure under construction; y down, origin at the top left. A shape with a coordinate that is not finite is
/// omitted. Colours are the classes of the page's style sheet: s0…s7 (strokes), f0…f7 (fills), axis, gridline, frame, ref.
class SvgCanvas {
 public:
  using Point = std::pair<double, double>;

  /// `title` is the text for screen readers.
  SvgCanvas(double width, double height, std::string title) : width_(width), height_(height), title_(std::move(title)) {}

  void Line(double x1, double y1, double x2, double y2, const std::string& css_class, double stroke_width = 1);
  /// `tooltip` appears under the pointer.
  void Rect(double x, double y, double width, double height, const std::string& css_class, const std::string& tooltip = {});
  void Circle(double x, double y, double radius, const std::string& css_class, const std::string& tooltip = {});
  /// A PNG or JPEG, stretched over the rectangle; nothing for other bytes.
  void EmbedImage(double x, double y, double width, double height, std::string_view bytes);
  /// `anchor`: "start", "middle" or "end".
  void Text(double x, double y, const std::string& text, const std::string& anchor = "start", const std::string& css_class = {},
            double rotate_deg = 0);
  /// Points that are not finite break the line there.
  void Polyline(const std::vector<Point>& points, const std::string& css_class, double stroke_width = 1.5, bool dashed = false);
  void Polygon(const std::vector<Point>& points, const std::string& css_class, double stroke_width = 1);
  /// Many separate segments (from, to) as one path. `colour`: "#rrggbb" instead of the class's, or empty.
  void Segments(const std::vector<std::pair<Point, Point>>& segments, const std::string& css_class, double stroke_width = 1,
                const std::string& colour = {});
  /// Many round dots as one path.
  void Dots(const std::vector<Point>& points, const std::string& css_class, double diameter);
  /// Many circles as one path.
  void Rings(const std::vector<Point>& centres, const std::string& css_class, double radius, double stroke_width);
  /// A shaft with a filled head.
  void Arrow(double x1, double y1, double x2, double y2, int colour, double stroke_width = 2);

  /// Clips everything drawn until EndClip to the rectangle.
  void BeginClip(double x, double y, double width, double height);
  void EndClip();

  double width() const { return width_; }
  double height() const { return height_; }
  std::string Finish() const;

 private:
  double width_, height_;
  std::string title_, body_;
};

/// Approximate width of a label in the figures' 12 px font (px).
double TextWidth(const std::string& text);
/// Palette index, limited to the eight colours.
std::string StrokeClass(int colour);
std::string FillClass(int colour);

}  // namespace mvstudio::report
