#include "dataset/pose/pose3d_c3d.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/label.h"
#include "dataset/pose/c3d_parameters.h"
#include "dataset/pose/marker_labels.h"

namespace mvstudio::dataset {
namespace {

using internal::C3dParameters;

constexpr size_t kBlock = 512;

/// Where the points lie, and how they are stored.
struct Layout {
  size_t num_points = 0, num_frames = 0, begin = 0, frame_bytes = 0;
  int first_frame = 1;
  double scale = 1;  ///< negative: floats
  bool is_float() const { return scale < 0; }
};

using Notes = std::vector<std::string>;

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

/// The factor of the points. The parameters count where the header's copy differs: its sign says floats or integers.
double ScaleOf(const std::string& path, const C3dParameters& c3d, Notes* notes) {
  const double header = c3d.bytes().Float(12), scale = c3d.Number("POINT:SCALE", 0, header);
  if (!std::isfinite(scale) || scale == 0) throw FormatError(path, "POINT:SCALE", "the scale of the points is no number, or 0");
  const bool same = header == scale || (header < 0 && scale < 0);  // floats are stored in the file's unit
  if (!same) notes->push_back(Format("POINT:SCALE is %g, its header says %g; POINT:SCALE is used", scale, header));
  return scale;
}

/// The points of a frame. The header's count must be that of the parameters.
size_t PointsOf(const std::string& path, const C3dParameters& c3d) {
  const size_t count = c3d.bytes().Word(2);
  if (count == 0 && c3d.Has("ROTATION:LABELS"))
    throw FormatError(path, "header",
                      "holds no 3D points but rotations of segments (ROTATION, as Theia writes them), which are not read; "
                      "export the joint centres as points, to .c3d or .trc");
  if (count == 0) throw FormatError(path, "header", "holds no 3D points; analog data alone are not read");
  const double used = c3d.Number("POINT:USED", 0, static_cast<double>(count));
  if (used != static_cast<double>(count))
    throw FormatError(path, "POINT:USED", Format("is %g, the header says %zu points; one of them is damaged", used, count));
  return count;
}

/// Frames that fit between the first point and the file's end, or what stands behind the points: parameters, rotations. The
/// last may be the zeros that fill the last block.
size_t HeldFrames(const C3dParameters& c3d, const Layout& layout) {
  size_t end = c3d.begin() > layout.begin ? c3d.begin() : c3d.bytes().size();
  const double rotations = (c3d.Number("ROTATION:DATA_START", 0, 0) - 1) * static_cast<double>(kBlock);
  const size_t counted = layout.begin + layout.num_frames * layout.frame_bytes;
  if (rotations >= static_cast<double>(counted)) end = std::min(end, static_cast<size_t>(rotations));
  return end <= layout.begin ? 0 : (end - layout.begin) / layout.frame_bytes;
}

bool IsZero(const C3dParameters& c3d, const Layout& layout, size_t frame) {
  const size_t at = layout.begin + frame * layout.frame_bytes;
  for (size_t i = at; i < at + layout.frame_bytes; ++i) {
    if (c3d.bytes().Byte(i) != 0) return false;
  }
  return true;
}

/// The frames of a file that holds more of them than it counts: all where the 16-bit count is at its end or began anew.
size_t BeyondCount(const C3dParameters& c3d, const Layout& layout, size_t held, bool at_end, Notes* notes) {
  constexpr size_t kTurn = 65536;
  const size_t counted = layout.num_frames, filling = kBlock / layout.frame_bytes + 1;
  if (held <= counted + filling) return counted;
  const size_t rotated = counted + (held - counted) / kTurn * kTurn;
  if (rotated > counted && held - rotated <= filling) {
    notes->push_back(Format("it counts %zu frames, its size is that of %zu: the count began anew after 65536; all are read",
                            counted, rotated));
    return rotated;
  }
  if (at_end) {
    size_t frames = held;
    while (frames + filling > held && frames > counted && IsZero(c3d, layout, frames - 1)) --frames;
    notes->push_back(Format("it counts %zu frames, as many as 16 bits can, and holds %zu; all are read", counted, frames));
    return frames;
  }
  while (held > counted && IsZero(c3d, layout, held - 1)) --held;
  if (held == counted) return counted;
  notes->push_back(Format("it counts %zu frames, its size is that of %zu; those behind the count are not read", counted, held));
  return counted;
}

/// Counts against the file's size, both ways.
void CheckFrames(const std::string& path, const C3dParameters& c3d, bool at_end, Layout* layout, Notes* notes) {
  const size_t held = HeldFrames(c3d, *layout);
  if (held >= layout->num_frames) {
    layout->num_frames = BeyondCount(c3d, *layout, held, at_end, notes);
    return;
  }
  if (held == 0)
    throw FormatError(path, "frame 0", Format("the file is cut off: it holds none of %zu frames", layout->num_frames));
  notes->push_back(
      Format("it states %zu frames and holds %zu: the file is cut off; what it holds is read", layout->num_frames, held));
  layout->num_frames = held;
}

void CheckRates(const C3dParameters& c3d, Notes* notes) {
  const double header_hz = c3d.bytes().Float(20), rate_hz = c3d.Number("POINT:RATE", 0, header_hz);
  constexpr double kTolerance = 0.01;
  if (header_hz > 0 && rate_hz > 0 && !(std::abs(rate_hz / header_hz - 1) <= kTolerance))
    notes->push_back(Format("POINT:RATE is %g frames a second, its header says %g", rate_hz, header_hz));
}

Layout ReadLayout(const std::string& path, const C3dParameters& c3d, Notes* notes) {
  constexpr double kMaxFrame = 1e9;
  const internal::C3dBytes& bytes = c3d.bytes();
  Layout layout;
  layout.num_points = PointsOf(path, c3d);
  layout.scale = ScaleOf(path, c3d, notes);
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
  CheckFrames(path, c3d, last == 65535, &layout, notes);
  CheckRates(c3d, notes);
  return layout;
}

/// A list of texts; beyond 255 it goes on in NAME2, NAME3, …
std::vector<std::string> LongList(const C3dParameters& c3d, const std::string& name) {
  std::vector<std::string> texts = c3d.Texts(name);
  for (int more = 2; c3d.Has(name + std::to_string(more)); ++more) {
    const std::vector<std::string> part = c3d.Texts(name + std::to_string(more));
    texts.insert(texts.end(), part.begin(), part.end());
  }
  return texts;
}

/// Labels whose three numbers are no place: angles, forces, moments, powers and the like that models compute and files list by
/// kind (https://www.c3d.org/HTML/Documents/pointtypegroups.htm).
std::set<std::string> ModelOutputs(const C3dParameters& c3d) {
  std::vector<std::string> kinds = c3d.Texts("POINT:TYPE_GROUPS");
  for (const char* usual : {"ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS"}) kinds.push_back(usual);
  std::set<std::string> labels;
  for (const std::string& kind : kinds) {
    if (kind == "LABELS") continue;
    for (const std::string& label : LongList(c3d, "POINT:" + kind)) labels.insert(label);
  }
  labels.erase("");
  return labels;
}

std::vector<std::string> LabelsOf(const std::string& path, const C3dParameters& c3d, size_t count) {
  std::vector<std::string> labels = LongList(c3d, "POINT:LABELS");
  labels.resize(count);
  for (size_t i = 0; i < count; ++i) {
    if (labels[i].empty()) labels[i] = "point_" + std::to_string(i + 1);
    const std::string why = WhyNotALabel(labels[i]);
    if (!why.empty()) throw FormatError(path, "POINT:LABELS[" + std::to_string(i) + "]", why);
  }
  return labels;
}

/// The points that are places in space; the others are told.
std::vector<size_t> PlacesAmong(const std::string& path, const std::vector<std::string>& labels,
                                const std::set<std::string>& outputs, Notes* notes) {
  std::vector<size_t> places;
  std::vector<std::string> others;
  for (size_t i = 0; i < labels.size(); ++i) {
    if (outputs.count(labels[i]) == 0)
      places.push_back(i);
    else
      others.push_back(labels[i]);
  }
  if (places.empty()) throw FormatError(path, "POINT:LABELS", "holds angles, forces and moments alone, no point is a place");
  if (others.empty()) return places;
  constexpr size_t kShown = 3;
  const size_t count = others.size();
  others.resize(std::min(count, kShown));
  notes->push_back(Format("%zu of its %zu points are angles, forces, moments or the like of a model (", count, labels.size()) +
                   Join(others, ", ") + (count > kShown ? ", …" : "") + "); they are left out");
  return places;
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
  MarkerFile file;
  const Layout layout = ReadLayout(path, c3d, &file.notes);
  file.pose.skeleton = "points";
  const double rate_hz = c3d.Number("POINT:RATE", 0, c3d.bytes().Float(20));
  if (std::isfinite(rate_hz) && rate_hz > 0) file.pose.frame_rate_hz = rate_hz;
  file.unit = UnitOf(path, c3d, unit);
  const std::vector<std::string> up = c3d.Texts("POINT:Y_SCREEN");
  file.y_up = !up.empty() && up[0] == "+Y";
  const double metres = MetresPerUnit(file.unit).value_or(1);
  const std::vector<std::string> labels = LabelsOf(path, c3d, layout.num_points);
  const std::vector<internal::MarkerLabel> markers = internal::SplitLabels(labels);
  const std::vector<size_t> places = PlacesAmong(path, labels, ModelOutputs(c3d), &file.notes);
  for (size_t f = 0; f < layout.num_frames; ++f) {
    for (const size_t m : places) {
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
