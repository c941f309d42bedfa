#include "dataset/pose/pose3d_c3d.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/label.h"
#include "dataset/pose/c3d_parameters.h"

namespace mvstudio::dataset {
namespace {

using internal::C3dParameters;

/// Where the points lie, and how they are stored.
struct Layout {
  size_t num_points = 0, num_frames = 0, begin = 0, frame_bytes = 0;
  int first_frame = 1;
  double scale = 1;  ///< negative: floats
  bool is_float() const { return scale < 0; }
};

/// Two 16-bit halves of a frame's number; 0 where the parameter is missing.
double LongNumber(const C3dParameters& c3d, const std::string& name) {
  return c3d.Number(name, 0, 0) + 65536 * c3d.Number(name, 1, 0);
}

/// First and last frame, counted from 1.
std::pair<double, double> FramesOf(const C3dParameters& c3d) {
  const double first = c3d.bytes().Word(6), last = c3d.bytes().Word(8);
  const double start = LongNumber(c3d, "TRIAL:ACTUAL_START_FIELD"), end = LongNumber(c3d, "TRIAL:ACTUAL_END_FIELD");
  if (start >= 1 && end >= start) return {start, end};
  const double count = c3d.Number("POINT:LONG_FRAMES", 0, 0);
  return {first, last == 65535 && count > last ? first + count - 1 : last};
}

Layout ReadLayout(const std::string& path, const C3dParameters& c3d) {
  constexpr size_t kBlock = 512;
  constexpr double kMaxFrame = 1e9;
  const internal::C3dBytes& bytes = c3d.bytes();
  Layout layout;
  layout.num_points = bytes.Word(2);
  layout.scale = bytes.Float(12);
  if (layout.num_points == 0) throw FormatError(path, "header", "holds no 3D points; analog data alone are not read");
  if (!std::isfinite(layout.scale) || layout.scale == 0)
    throw FormatError(path, "header", "the scale of the points is no number, or 0");
  const size_t data_block = bytes.Word(16);
  const size_t width = layout.is_float() ? 4 : 2;
  layout.frame_bytes = width * (4 * layout.num_points + bytes.Word(4));
  if (data_block < 2) throw FormatError(path, "header", "does not say where the points begin");
  layout.begin = (data_block - 1) * kBlock;
  const auto [first, last] = FramesOf(c3d);
  if (!(first >= 0 && last >= first && last < kMaxFrame))
    throw FormatError(path, "header",
                      "the frames have no order: first " + std::to_string(first) + ", last " + std::to_string(last));
  layout.first_frame = static_cast<int>(first);
  layout.num_frames = static_cast<size_t>(last - first) + 1;
  const size_t held = bytes.size() <= layout.begin ? 0 : (bytes.size() - layout.begin) / layout.frame_bytes;
  if (held < layout.num_frames) {
    throw FormatError(path, "frame " + std::to_string(held),
                      "the file is cut off: it holds " + std::to_string(held) + " of " + std::to_string(layout.num_frames) +
                          " frames; copy it again");
  }
  return layout;
}

/// "SUBJECT:MARKER" apart; without a colon the subject is empty.
struct Marker {
  int person = 0;
  std::string name;
};

std::vector<std::string> LabelsOf(const std::string& path, const C3dParameters& c3d, size_t count) {
  std::vector<std::string> labels = c3d.Texts("POINT:LABELS");
  for (int more = 2; labels.size() < count && c3d.Has("POINT:LABELS" + std::to_string(more)); ++more) {
    const std::vector<std::string> part = c3d.Texts("POINT:LABELS" + std::to_string(more));
    labels.insert(labels.end(), part.begin(), part.end());
  }
  labels.resize(count);
  for (size_t i = 0; i < count; ++i) {
    if (labels[i].empty()) labels[i] = "point_" + std::to_string(i + 1);
    const std::string why = WhyNotALabel(labels[i]);
    if (!why.empty()) throw FormatError(path, "POINT:LABELS[" + std::to_string(i) + "]", why);
  }
  return labels;
}

std::vector<Marker> MarkersOf(const std::vector<std::string>& labels) {
  std::vector<std::string> subjects;
  std::set<std::pair<int, std::string>> seen;
  std::vector<Marker> markers;
  for (const std::string& label : labels) {
    const size_t colon = label.find(':');
    const bool split = colon != std::string::npos && colon + 1 < label.size();
    const std::string subject = split ? label.substr(0, colon) : "";
    auto known = std::find(subjects.begin(), subjects.end(), subject);
    if (known == subjects.end()) known = subjects.insert(known, subject);
    Marker marker{static_cast<int>(known - subjects.begin()), split ? label.substr(colon + 1) : label};
    const std::string name = marker.name;
    for (int number = 2; !seen.insert({marker.person, marker.name}).second; ++number) {
      marker.name = name + "_" + std::to_string(number);
    }
    markers.push_back(std::move(marker));
  }
  return markers;
}

/// x, y, z in the file's axes and units; not finite where the point is missing.
Eigen::Vector3d PointAt(const C3dParameters& c3d, const Layout& layout, size_t frame, size_t point) {
  const internal::C3dBytes& bytes = c3d.bytes();
  const size_t width = layout.is_float() ? 4 : 2, at = layout.begin + frame * layout.frame_bytes + 4 * width * point;
  const auto value = [&](size_t k) { return layout.is_float() ? bytes.Float(at + 4 * k) : bytes.Int(at + 2 * k); };
  Eigen::Vector3d x(value(0), value(1), value(2));
  if (!(value(3) >= 0)) return Eigen::Vector3d::Constant(std::nan(""));
  return layout.is_float() ? x : Eigen::Vector3d(layout.scale * x);
}

std::string UnitOf(const std::string& path, const C3dParameters& c3d, const std::string& unit) {
  if (!unit.empty()) return unit;
  const std::vector<std::string> stated = c3d.Texts("POINT:UNITS");
  const std::string word = stated.empty() ? "" : stated[0];
  if (MetresPerUnit(word)) return word;
  throw FormatError(path, "POINT:UNITS",
                    (word.empty() ? "is missing" : "`" + word + "` is none of m, cm, mm and in") +
                        std::string("; name the unit by option 'marker-unit'"));
}

}  // namespace

MarkerFile ReadC3dMarkers(const std::string& path, const std::string& unit) {
  const std::string text = ReadFile(path);
  const C3dParameters c3d(path, text);
  const Layout layout = ReadLayout(path, c3d);
  MarkerFile file;
  file.pose.skeleton = "points";
  file.unit = UnitOf(path, c3d, unit);
  const std::vector<std::string> up = c3d.Texts("POINT:Y_SCREEN");
  file.y_up = !up.empty() && up[0] == "+Y";
  const double metres = MetresPerUnit(file.unit).value_or(1);
  const std::vector<Marker> markers = MarkersOf(LabelsOf(path, c3d, layout.num_points));
  for (size_t f = 0; f < layout.num_frames; ++f) {
    for (size_t m = 0; m < markers.size(); ++m) {
      JointRow& row = file.pose.rows.emplace_back();
      row.frame = std::max(0, layout.first_frame - 1) + static_cast<int>(f);
      row.person = markers[m].person, row.joint = markers[m].name;
      const Eigen::Vector3d x = metres * PointAt(c3d, layout, f, m);
      if (!x.allFinite()) continue;
      row.status = Status::kOk;
      row.x_in_world = file.y_up ? Eigen::Vector3d(x.z(), x.x(), x.y()) : x;
    }
  }
  std::stable_sort(file.pose.rows.begin(), file.pose.rows.end(), [](const JointRow& a, const JointRow& b) {
    return std::pair(a.frame, a.person) < std::pair(b.frame, b.person);
  });
  return file;
}

}  // namespace mvstudio::dataset
