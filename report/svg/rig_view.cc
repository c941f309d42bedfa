#include "report/svg/rig_view.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "report/page/format.h"
#include "report/svg/canvas.h"
#include "report/svg/labels.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

constexpr double kTitleHeight = 24;
using Point = SvgCanvas::Point;

double Dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector3 Cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector3 AddScaled(const Vector3& a, const Vector3& b, double s) { return {a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]}; }
bool IsFinite(const Vector3& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }
Vector3 Column(const ViewCamera& camera, int i) {
  return {camera.world_from_cam[0][i], camera.world_from_cam[1][i], camera.world_from_cam[2][i]};
}

/// An orthographic look at the world: image right and image up, in world.
struct Look {
  Vector3 right, up;
  std::string right_name, up_name;
};

Vector3 SignedAxis(int axis) {
  Vector3 v{};
  v[std::abs(axis) - 1] = axis > 0 ? 1 : -1;
  return v;
}

std::string AxisName(int axis) { return std::string(axis > 0 ? "" : "\u2212") + "xyz"[std::abs(axis) - 1]; }

Look TopLook(int up_axis) {
  // Right and image-up are two of the world's axes with right x image-up = up: not mirrored.
  const int first = std::abs(up_axis) == 1 ? 2 : 1;
  const Vector3 right = SignedAxis(first), up = Cross(SignedAxis(up_axis), right);
  int second = 1;
  for (int i = 0; i < 3; ++i) {
    if (std::fabs(up[i]) > 0.5) second = up[i] > 0 ? i + 1 : -(i + 1);
  }
  return {right, SignedAxis(second), AxisName(first), AxisName(second)};
}

Look CornerLook(int up_axis) {
  const Look top = TopLook(up_axis);
  const double azimuth = 0.62, elevation = 0.42;
  const Vector3 vertical = SignedAxis(up_axis);
  Vector3 right{}, back{};
  right = AddScaled(AddScaled(right, top.right, std::cos(azimuth)), top.up, std::sin(azimuth));
  back = AddScaled(AddScaled(back, top.right, -std::sin(azimuth)), top.up, std::cos(azimuth));
  Vector3 up{};
  up = AddScaled(AddScaled(up, back, std::sin(elevation)), vertical, std::cos(elevation));
  return {right, up, "", ""};
}

std::array<Vector3, 4> FrustumCorners(const ViewCamera& camera, double depth) {
  std::array<Vector3, 4> corners;
  const double signs[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  for (int i = 0; i < 4; ++i) {
    Vector3 corner = AddScaled(camera.center_in_world, Column(camera, 2), depth);
    corner = AddScaled(corner, Column(camera, 0), signs[i][0] * camera.half_width * depth);
    corners[i] = AddScaled(corner, Column(camera, 1), signs[i][1] * camera.half_height * depth);
  }
  return corners;
}

double Extent(const std::vector<ViewCamera>& cameras, const ViewSubject& subject) {
  Vector3 low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};
  const auto grow = [&](const Vector3& p) {
    for (int i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
  };
  for (const ViewCamera& camera : cameras) grow(camera.center_in_world);
  for (const Vector3& p : subject.cloud) grow(p);
  double extent = 0;
  for (int i = 0; i < 3; ++i) extent = std::max(extent, high[i] - low[i]);
  return extent > 0 ? extent : 1;
}

/// World to canvas with equal scale both ways.
class View {
 public:
  /// `margin`: canvas px left free at the sides, for the names.
  View(const Look& look, const std::vector<Vector3>& content, double width, double margin, double* height) : look_(look) {
    double low_u = 1e300, high_u = -1e300, low_v = 1e300, high_v = -1e300;
    for (const Vector3& p : content) {
      const double u = Dot(look.right, p), v = Dot(look.up, p);
      low_u = std::min(low_u, u), high_u = std::max(high_u, u), low_v = std::min(low_v, v), high_v = std::max(high_v, v);
    }
    const double side = std::max({high_u - low_u, (high_v - low_v) / 1.1, 1e-9});
    scale_ = (width - 2 * margin) / side;
    *height = kTitleHeight + std::max(140.0, (high_v - low_v) * scale_ + 70) + 26;
    offset_u_ = width / 2 - (low_u + high_u) / 2 * scale_;
    offset_v_ = kTitleHeight + (*height - kTitleHeight - 26) / 2 + (low_v + high_v) / 2 * scale_;
  }
  Point operator()(const Vector3& p) const {
    return {offset_u_ + Dot(look_.right, p) * scale_, offset_v_ - Dot(look_.up, p) * scale_};
  }
  double scale() const { return scale_; }

 private:
  Look look_;
  double scale_ = 1, offset_u_ = 0, offset_v_ = 0;
};

using Segment3 = std::pair<Vector3, Vector3>;

/// A grid of round spacing below `content`, in world.
std::vector<Segment3> FloorLines(int up_axis, double extent, const std::vector<Vector3>& content) {
  const Vector3 up = SignedAxis(up_axis);
  const Look top = TopLook(up_axis);
  double floor = 1e300, low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
  for (const Vector3& p : content) {
    floor = std::min(floor, Dot(up, p));
    const double at[2] = {Dot(top.right, p), Dot(top.up, p)};
    for (int i = 0; i < 2; ++i) low[i] = std::min(low[i], at[i]), high[i] = std::max(high[i], at[i]);
  }
  const double step = NiceBelow(extent / 4);
  const double a0 = std::floor(low[0] / step), b0 = std::floor(low[1] / step);
  const double columns = std::ceil(high[0] / step) - a0, rows = std::ceil(high[1] / step) - b0;
  std::vector<Segment3> lines;
  if (!(columns >= 0 && columns < 100 && rows >= 0 && rows < 100)) return lines;  // a rig too far from the origin for its size
  const auto place = [&](double a, double b) {
    return AddScaled(AddScaled(AddScaled(Vector3{}, top.right, (a0 + a) * step), top.up, (b0 + b) * step), up, floor);
  };
  for (int a = 0; a <= static_cast<int>(columns); ++a) lines.emplace_back(place(a, 0), place(a, rows));
  for (int b = 0; b <= static_cast<int>(rows); ++b) lines.emplace_back(place(0, b), place(columns, b));
  return lines;
}

void DrawLines(SvgCanvas* canvas, const View& view, const std::vector<Segment3>& lines, const std::string& css_class,
               double width) {
  std::vector<std::pair<Point, Point>> segments;
  for (const auto& [a, b] : lines) segments.emplace_back(view(a), view(b));
  canvas->Segments(segments, css_class, width);
}

void DrawSubject(SvgCanvas* canvas, const View& view, const ViewSubject& subject) {
  std::vector<Point> dots, path;
  for (const Vector3& p : subject.cloud) dots.push_back(view(p));
  canvas->Dots(dots, "s2 faint", 2);
  for (const Vector3& p : subject.path) path.push_back(view(p));
  canvas->Polyline(path, "s1", 1.6);
  std::map<std::string, std::vector<std::pair<Point, Point>>> by_colour;
  for (const ViewBone& bone : subject.bones) by_colour[bone.colour].emplace_back(view(bone.from), view(bone.to));
  for (const auto& [colour, bones] : by_colour) canvas->Segments(bones, "err", 2, colour);
}

void DrawCamera(SvgCanvas* canvas, const View& view, const ViewCamera& camera, double depth) {
  const Point centre = view(camera.center_in_world);
  std::vector<Point> corners;
  for (const Vector3& corner : FrustumCorners(camera, depth)) corners.push_back(view(corner));
  canvas->Polygon(corners, "f0 soft", 0);
  std::vector<std::pair<Point, Point>> edges;
  for (size_t i = 0; i < corners.size(); ++i) {
    edges.emplace_back(centre, corners[i]);
    edges.emplace_back(corners[i], corners[(i + 1) % corners.size()]);
  }
  canvas->Segments(edges, "s0", 1.2);
  canvas->Circle(centre.first, centre.second, 2.5, "f0", camera.name);
}

/// Outwards, away from where the cameras look.
void DrawNames(SvgCanvas* canvas, const View& view, const std::vector<ViewCamera>& cameras) {
  Vector3 middle{};
  for (const ViewCamera& c : cameras) middle = AddScaled(middle, c.center_in_world, 1.0 / static_cast<double>(cameras.size()));
  const Point inside = view(middle);
  std::vector<PointLabel> labels;
  for (const ViewCamera& c : cameras) {
    const Point at = view(c.center_in_world);
    labels.push_back({at, c.name, std::atan2(at.second - inside.second, at.first - inside.first)});
  }
  DrawPointLabels(canvas, labels, kTitleHeight, canvas->height() - 24);
}

void DrawScaleBar(SvgCanvas* canvas, const View& view, double extent, const Look& look) {
  const double length = NiceBelow(extent / 3), y = canvas->height() - 12, end = 12 + length * view.scale();
  canvas->Segments({{{12, y}, {end, y}}, {{12, y - 4}, {12, y + 4}}, {{end, y - 4}, {end, y + 4}}}, "err", 1.5);
  canvas->Text(end + 7, y + 4, length < 0.1 ? FormatWithUnit(1e3 * length, "mm") : FormatWithUnit(length, "m"), "start", "x");
  if (look.right_name.empty()) return;
  const double x = canvas->width() - 62, base = canvas->height() - 18;
  canvas->Segments({{{x, base}, {x + 24, base}}, {{x, base}, {x, base - 24}}}, "axis");
  canvas->Text(x + 28, base + 4, look.right_name, "start", "x");
  canvas->Text(x, base - 28, look.up_name, "middle", "x");
}

std::string DrawRig(const std::vector<ViewCamera>& all, const ViewSubject& subject, const Look& look, int up_axis,
                    const std::string& title, double width) {
  std::vector<ViewCamera> cameras;
  for (const ViewCamera& c : all) {
    if (IsFinite(c.center_in_world) && IsFinite(Column(c, 0)) && IsFinite(Column(c, 2))) cameras.push_back(c);
  }
  const double extent = Extent(cameras, subject), depth = 0.13 * extent;
  std::vector<Vector3> content;
  for (const ViewCamera& c : cameras) {
    content.push_back(c.center_in_world);
    for (const Vector3& corner : FrustumCorners(c, depth)) content.push_back(corner);
  }
  content.insert(content.end(), subject.cloud.begin(), subject.cloud.end());
  if (content.empty()) content.push_back({0, 0, 0});
  const std::vector<Segment3> floor = FloorLines(up_axis, extent, content);
  for (const auto& [a, b] : floor) content.insert(content.end(), {a, b});
  double margin = 24, height = 0;
  for (const ViewCamera& c : cameras) margin = std::max(margin, std::min(width / 4, 14 + TextWidth(c.name)));
  const View view(look, content, width, margin, &height);
  SvgCanvas canvas(width, height, title);
  canvas.Text(2, 14, title, "start", "t");
  DrawLines(&canvas, view, floor, "gridline", 1);
  DrawSubject(&canvas, view, subject);
  for (const ViewCamera& c : cameras) DrawCamera(&canvas, view, c, depth);
  DrawNames(&canvas, view, cameras);
  DrawScaleBar(&canvas, view, extent, look);
  return canvas.Finish();
}

}  // namespace

void SetPose(const std::array<double, 4>& rotation_xyzw, const Vector3& translation_m, ViewCamera* camera) {
  const auto& q = rotation_xyzw;
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double x = q[0] / norm, y = q[1] / norm, z = q[2] / norm, w = q[3] / norm;
  // Rows of cam_from_world are the camera's axes in world.
  const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                          {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                          {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  for (int i = 0; i < 3; ++i) {
    camera->center_in_world[i] = 0;
    for (int j = 0; j < 3; ++j) {
      camera->world_from_cam[i][j] = r[j][i];
      camera->center_in_world[i] -= r[j][i] * translation_m[j];
    }
  }
}

int UpAxis(const std::vector<ViewCamera>& cameras) {
  Vector3 up{};
  for (const ViewCamera& camera : cameras) {
    if (IsFinite(Column(camera, 1))) up = AddScaled(up, Column(camera, 1), -1);
  }
  // z is up by convention: another axis must be clearly better.
  int best = 3;
  double most = up[2] * 1.2;
  for (const int axis : {-3, 1, -1, 2, -2}) {
    const double along = Dot(up, SignedAxis(axis));
    if (along > most + 1e-9) best = axis, most = along;
  }
  return best;
}

std::string RigTopView(const std::vector<ViewCamera>& cameras, const ViewSubject& subject, double width) {
  const int up = UpAxis(cameras);
  return DrawRig(cameras, subject, TopLook(up), up, "From above (world " + AxisName(up) + " is up)", width);
}

std::string SubjectView(const std::vector<ViewCamera>& cameras, const ViewSubject& subject, double width) {
  if (subject.bones.empty()) return {};
  ViewSubject pose{{}, {}, subject.bones};
  for (const ViewBone& bone : subject.bones) pose.cloud.insert(pose.cloud.end(), {bone.from, bone.to});
  const int up = UpAxis(cameras);
  return DrawRig({}, pose, CornerLook(up), up, "The pose, enlarged", width);
}

std::string RigCornerView(const std::vector<ViewCamera>& cameras, const ViewSubject& subject, double width) {
  const int up = UpAxis(cameras);
  return DrawRig(cameras, subject, CornerLook(up), up, "From a corner above, orthographic", width);
}

}  // namespace mvstudio::report
