#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/label.h"
#include "dataset/trackers/tracker_readers.h"
#include "dataset/trackers/tracker_table.h"

namespace mvstudio::dataset::internal {
namespace {

enum Axis { kFrame, kTrack, kNode, kXy, kNumAxes };
constexpr const char* kAxisNames[kNumAxes] = {"frame", "track", "node", "xy"};

/// Which dimension of an array is which axis, and its strides; an axis that the array lacks has stride 0.
struct Layout {
  size_t size[kNumAxes] = {1, 1, 1, 1}, stride[kNumAxes] = {};

  Layout(const std::vector<Axis>& order, const std::vector<uint64_t>& dims) {
    size_t step = 1;
    for (size_t k = order.size(); k-- > 0;) {
      size[order[k]] = dims[k], stride[order[k]] = step;
      step *= dims[k];
    }
  }
  size_t At(size_t frame, size_t track, size_t node, size_t xy) const {
    return frame * stride[kFrame] + track * stride[kTrack] + node * stride[kNode] + xy * stride[kXy];
  }
};

/// The order that the attribute `dims` of `tracks` states as a JSON list; empty without that attribute.
std::vector<Axis> StatedOrder(const ForeignHdf5& file) {
  std::vector<Axis> order;
  if (!file.HasAttribute("/tracks", "dims")) return order;
  const nlohmann::json stated = nlohmann::json::parse(file.TextAttribute("/tracks", "dims"), nullptr, false);
  for (size_t i = 0; stated.is_array() && i < stated.size(); ++i) {
    for (int axis = 0; axis < kNumAxes; ++axis) {
      const bool is_new = std::find(order.begin(), order.end(), static_cast<Axis>(axis)) == order.end();
      if (stated[i] == kAxisNames[axis] && is_new) order.push_back(static_cast<Axis>(axis));
    }
  }
  if (order.size() != kNumAxes) file.Fail("/tracks@dims", "is not a list of frame, track, node and xy");
  return order;
}

std::vector<Axis> OrderOf(const ForeignHdf5& file, const std::vector<uint64_t>& dims, size_t nodes) {
  const std::vector<Axis> matlab = {kTrack, kXy, kNode, kFrame}, plain = {kFrame, kNode, kXy, kTrack};
  if (dims.size() != kNumAxes) file.Fail("/tracks", "has " + std::to_string(dims.size()) + " dimensions instead of 4");
  std::vector<Axis> order = StatedOrder(file);
  if (order.empty()) order = dims[1] == 2 && dims[2] == nodes ? matlab : plain;
  const Layout layout(order, dims);
  if (layout.size[kXy] == 2 && layout.size[kNode] == nodes) return order;
  std::string text;
  for (const uint64_t d : dims) text += (text.empty() ? "" : " x ") + std::to_string(d);
  file.Fail("/tracks", text + " is not tracks x 2 x " + std::to_string(nodes) + " nodes x frames");
}

/// Names of the tracks; those of a file without tracks are empty.
std::vector<std::string> TrackNames(const ForeignHdf5& file, size_t count) {
  std::vector<std::string> names = file.Has("/track_names") ? file.Texts("/track_names") : std::vector<std::string>();
  if (!names.empty() && names.size() != count) {
    file.Fail("/track_names", std::to_string(names.size()) + " names for " + std::to_string(count) + " tracks");
  }
  names.resize(count);
  return names;
}

/// point_scores has the axes of `tracks` without xy; all NaN where the file has none.
struct Scores {
  std::vector<double> values;
  Layout layout{{}, {}};

  double At(size_t frame, size_t track, size_t node) const {
    return values.empty() ? std::nan("") : values[layout.At(frame, track, node, 0)];
  }
};

/// Before anything is unpacked: the layout of the scores, empty without scores.
std::optional<Layout> LayoutOfScores(const ForeignHdf5& file, std::vector<Axis> order, std::vector<uint64_t> dims) {
  if (!file.Has("/point_scores")) return std::nullopt;
  const auto xy = std::find(order.begin(), order.end(), kXy);
  dims.erase(dims.begin() + (xy - order.begin()));
  order.erase(xy);
  if (file.Dims("/point_scores") != dims) file.Fail("/point_scores", "has other dimensions than /tracks");
  return Layout(order, dims);
}

/// edge_names: pairs of nodes, one after the other.
void ReadBones(const ForeignHdf5& file, TrackedPoints* points) {
  if (!file.Has("/edge_names")) return;
  const std::vector<std::string> names = file.Texts("/edge_names");
  const auto is_node = [&](const std::string& name) {
    return std::find(points->joints.begin(), points->joints.end(), name) != points->joints.end();
  };
  for (size_t i = 0; i + 1 < names.size(); i += 2) {
    if (is_node(names[i]) && is_node(names[i + 1])) points->bones.emplace_back(names[i], names[i + 1]);
  }
}

}  // namespace

TrackedPoints ReadSleapHdf5(const ForeignHdf5& file, const std::string& camera) {
  TrackedPoints points;
  points.program = "SLEAP";
  points.track.camera = camera;
  points.joints = file.Texts("/node_names");
  for (const std::string& joint : points.joints) {
    const std::string why = WhyNotALabel(joint);
    if (!why.empty()) file.Fail("/node_names", "a name " + why);
    if (std::count(points.joints.begin(), points.joints.end(), joint) > 1) file.Fail("/node_names", "`" + joint + "` twice");
  }
  ReadBones(file, &points);
  const std::vector<uint64_t> dims = file.Dims("/tracks");
  const std::vector<Axis> order = OrderOf(file, dims, points.joints.size());
  const Layout layout(order, dims);
  points.individuals = TrackNames(file, layout.size[kTrack]);
  const std::optional<Layout> layout_of_scores = LayoutOfScores(file, order, dims);
  const std::vector<double> xy = file.Numbers("/tracks");
  Scores scores;
  if (layout_of_scores) scores = {file.Numbers("/point_scores"), *layout_of_scores};
  if (xy.empty()) file.Fail("/tracks", "holds no point");
  for (size_t f = 0; f < layout.size[kFrame]; ++f) {
    std::vector<Person2d>& people = points.track.frames[static_cast<int>(f)];
    for (size_t t = 0; t < layout.size[kTrack]; ++t) {
      Person2d person;
      person.keypoints.reserve(points.joints.size());
      bool seen = false;
      for (size_t n = 0; n < points.joints.size(); ++n) {
        person.keypoints.push_back(ToKeypoint(xy[layout.At(f, t, n, 0)], xy[layout.At(f, t, n, 1)], scores.At(f, t, n)));
        seen |= person.keypoints.back().score > 0;
      }
      if (seen) people.push_back(std::move(person));
    }
  }
  return points;
}

}  // namespace mvstudio::dataset::internal
